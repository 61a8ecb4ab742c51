// Maps compiled on a cluster: Slurm with four nodes, all of them on this machine
// (tests/cluster/loopback_cluster).
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::SizeIs;

class Cluster : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>("cluster_test");
    ASSERT_NO_FATAL_FAILURE(RenderTinySurvey(*folder_ / "survey"));
    WriteRecipe("capture.toml", "k = 4");
    const ProgramRun local =
        RunShell(fmt::format("cairn compile {} -o {}", *folder_ / "capture.toml", *folder_ / "local.cairn"));
    ASSERT_EQ(local.exit_code, 0) << local.err;
    const ProgramRun started = RunShell(ClusterTool("start", "4"));
    ASSERT_EQ(started.exit_code, 0) << started.err;
  }
  static void TearDownTestSuite() {
    RunShell(ClusterTool("stop"));
    folder_.reset();
  }

  static void WriteRecipe(const std::string& name, const std::string& k) {
    WriteCaptureRecipe(*folder_ / name, {"survey"});
    ReplaceInFile(*folder_ / name, "k = 4", k);
  }

  static std::string ClusterTool(const std::string& verb, const std::string& argument = "") {
    return fmt::format("{} {} {} {}", CAIRN_LOOPBACK_CLUSTER, verb, *folder_ / "slurm", argument);
  }

  // The command that puts each stage on a node of its own and notes which; `first` runs before the stage.
  static std::string Launcher(const std::string& first = "") {
    const std::string script = *folder_ / "on_node";
    std::ofstream(script) << "#!/bin/sh\necho $SLURMD_NODENAME >> " << (*folder_ / "nodes") << "\n"
                          << first << "\nexec \"$@\"\n";
    fs::permissions(script, fs::perms::owner_all);
    return "srun --quiet -n1 " + script;
  }

  static std::string Compile(const std::string& name, const std::string& launcher,
                             const std::string& recipe = "capture.toml") {
    return fmt::format("SLURM_CONF={} cairn compile {} -o {} --shards 6 --shard-images 2 -j 4 --launch '{}'",
                       *folder_ / "slurm/slurm.conf", *folder_ / recipe, *folder_ / name, launcher);
  }

  static std::set<std::string> NodesUsed() {
    std::ifstream file(*folder_ / "nodes");
    std::set<std::string> nodes;
    for (std::string line; std::getline(file, line);) nodes.insert(line);
    return nodes;
  }

  static void ExpectSameBytesAsLocal(const std::string& name) {
    for (const char* file : {".build/features.db", ".build/matches.db", ".build/classes.db", ".cairn"}) {
      EXPECT_EQ(HashFile(*folder_ / (name + file)).value(),
                HashFile(*folder_ / ("local" + std::string(file))).value())
          << file;
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(*folder_ / (name + ".build"))) {
      EXPECT_THAT(entry.path().filename().string(),
                  testing::Not(testing::AnyOf(HasSubstr("of6"), HasSubstr("-plan"))))
          << "left by a shard";
    }
  }

  static std::unique_ptr<TemporaryFolder> folder_;
};
std::unique_ptr<TemporaryFolder> Cluster::folder_;

TEST_F(Cluster, ShardsOnFourNodesGiveTheBytesOfOneMachine) {
  const ProgramRun run = RunShell(Compile("sharded.cairn", Launcher()));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(NodesUsed(), SizeIs(4));
  EXPECT_THAT(run.out, testing::AllOf(HasSubstr("extract_features: shard 6/6"),
                                      HasSubstr("match_features: plan for 6 shards"),
                                      HasSubstr("match_features: shard 2/")));
  ExpectSameBytesAsLocal("sharded");
  const ProgramRun again = RunShell(Compile("sharded.cairn", Launcher()));
  EXPECT_THAT(again.out, HasSubstr("up to date"));
}

TEST_F(Cluster, ANodeThatDiesAtWorkCostsTimeOnly) {
  // Whatever comes to node2 first waits to be killed.
  const std::string busy = *folder_ / "busy";
  const std::string wait =
      "[ $SLURMD_NODENAME = node2 ] && [ ! -e " + busy + " ] && touch " + busy + " && sleep 60";
  const std::string killer = fmt::format("{{ while [ ! -e {} ]; do sleep 0.1; done; sleep 0.3; {}; }}", busy,
                                         ClusterTool("kill-node", "2"));
  const ProgramRun run = RunShell(killer + " & " + Compile("killed.cairn", Launcher(wait)));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  ASSERT_TRUE(fs::exists(busy));
  EXPECT_THAT(run.err, HasSubstr("no result and no error from 'srun'"));
  ExpectSameBytesAsLocal("killed");
}

TEST_F(Cluster, AStagesOwnErrorComesThroughTheLauncherAtOnce) {
  WriteRecipe("too_many.toml", "k = 100000");
  ReplaceInFile(*folder_ / "too_many.toml", "landmarks = \"all\"", "landmarks = \"regions\"");
  const ProgramRun local =
      RunShell(fmt::format("cp -a {0}.build {1}.build; cairn compile {1}.toml -o {1}.cairn",
                           *folder_ / "local", *folder_ / "too_many"));
  ASSERT_NE(local.exit_code, 0);
  const ProgramRun run = RunShell(Compile("too_many.cairn", Launcher(), "too_many.toml"));
  EXPECT_EQ(run.exit_code, local.exit_code) << run.err;
  EXPECT_THAT(run.err, testing::Not(HasSubstr("no result and no error")));
}

TEST_F(Cluster, ALauncherThatIsNotThereIsAnError) {
  const ProgramRun run = RunShell(Compile("unlaunched.cairn", "no_such_launcher"));
  EXPECT_NE(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("no_such_launcher: not found"));
}

}  // namespace
}  // namespace cairn
