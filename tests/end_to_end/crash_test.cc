// The files that a killed compile and a full disk leave, and that the next run finishes to the same bytes.

#include <sys/mount.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::AnyOf;
using testing::ContainsRegex;
using testing::HasSubstr;

struct Stage {
  const char* command;
  std::string output;  // beside the build folder's stamps; the map for the last
  std::string stamp;
};
const std::vector<Stage>& Line() {
  static const std::vector<Stage> line = {
      {"simulate", "capture", "capture"},
      {"extract-features", "features.db", "features.db"},
      {"match-features", "matches.db", "matches.db"},
      {"group-classes", "classes.db", "classes.db"},
      {"filter-visibility", "world.db", "world.db"},
      {"decompose-regions", "regions.db", "regions.db"},
      {"build-vocabulary", "vocabulary.db", "vocabulary.db"},
      {"link-appearance", "appearance.db", "appearance.db"},
      {"emit-map", "unsealed.cairn", "unsealed.cairn"},
      {"check", "../small.cairn", "map"},
  };
  return line;
}

// Path relative to `folder` -> hash.  Reports hold times and .reuse files what earlier runs knew: their names
// count only.
using Contents = std::map<std::string, std::string>;
Contents ContentsOf(const std::string& folder) {
  Contents contents;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    const std::string name = entry.path().lexically_relative(folder).string();
    const bool is_dated =
        name.ends_with(".report.json") || name.ends_with(".reuse") || name.ends_with("/lock");
    contents[name] = is_dated ? "" : HashFile(entry.path().string()).value();
  }
  return contents;
}

// A folder with a recipe, and its map compiled once.
class Workplace {
 public:
  explicit Workplace(const std::string& folder) : folder_(folder) {
    WriteSmallRecipe(folder_ + "/small.toml");
    const ProgramRun run = Compile();
    EXPECT_EQ(run.exit_code, 0) << run.err;
    clean_ = ContentsOf(folder_);
  }

  ProgramRun Compile(const std::string& prefix = "", const std::string& arguments = "") const {
    return RunShell(prefix + " cairn compile " + folder_ + "/small.toml -o " + folder_ +
                    "/small.cairn --progress none --log-level error " + arguments);
  }
  std::string Build(const std::string& name) const { return folder_ + "/small.build/" + name; }
  const std::string& folder() const { return folder_; }
  const Contents& clean() const { return clean_; }
  nlohmann::json Report() const {
    return nlohmann::json::parse(ReadFile(folder_ + "/small.report.json").value());
  }

  // The stage has to run again, over what is in the place of its output or nothing.
  void Forget(const Stage& stage) const {
    fs::remove(Build(stage.stamp + ".stamp"));
    fs::remove_all(Build(stage.output));
  }

  // Every file is the whole one of the clean build or that of `old`; temporaries may lie about where they
  // are `allowed`.
  void ExpectOnlyWholeFiles(const Contents& old, bool temporaries_allowed) const {
    for (const auto& [name, hash] : ContentsOf(folder_)) {
      if (name.find(".tmp-") != std::string::npos) {
        EXPECT_TRUE(temporaries_allowed) << name << " is left";
      } else if (const auto whole = clean_.find(name); whole != clean_.end()) {
        EXPECT_THAT(hash, AnyOf(whole->second, old.contains(name) ? old.at(name) : whole->second)) << name;
      } else {
        EXPECT_TRUE(old.contains(name) || name.ends_with("/error.json"))
            << name << " is not of a clean build";
      }
    }
  }

 private:
  std::string folder_;
  Contents clean_;
};

int NumKills() {
  const char* given = std::getenv("CAIRN_NUM_KILLS");
  return given != nullptr ? std::atoi(given) : 27;
}

// Runs the line until `stage` has made its last call or was killed; says how many calls it made.
int CountCalls(const Workplace& workplace, const Stage& stage) {
  const std::string file = workplace.folder() + "/../calls";
  fs::remove(file);
  workplace.Forget(stage);
  const ProgramRun run = workplace.Compile(std::string("LD_PRELOAD=" CAIRN_KILL_LIBRARY " LC_KILL_STAGE=") +
                                           stage.command + " LC_COUNT_CALLS=" + file);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const auto text = ReadFile(file);
  fs::remove(file);
  return text.ok() ? std::atoi(text.value().c_str()) : 0;
}

TEST(Kill, AnywhereThenCompileGivesTheSameBytesAndNoTemporaryIsLeft) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers want to be loaded before the library that kills";
#endif
  TemporaryFolder folder("kill_test");
  fs::create_directories(folder / "new");
  fs::create_directories(folder / "old");
  // Another seed: a survey, and files of every stage, that stand in the place of the new ones.
  const Workplace old(folder / "old");
  const ProgramRun reseeded = old.Compile("", "--seed 1");
  ASSERT_EQ(reseeded.exit_code, 0) << reseeded.err;
  const Contents old_contents = ContentsOf(old.folder());
  const Workplace workplace(folder / "new");

  std::mt19937_64 random(5);
  std::map<std::string, int> num_moments, num_killed;
  std::map<std::string, double> seconds;
  for (const auto& stage : workplace.Report()["stages"]) {
    std::string command = stage["stage"] == "check_map" ? "check" : stage["stage"].get<std::string>();
    std::replace(command.begin(), command.end(), '_', '-');
    seconds[command] = stage["seconds"];
  }
  for (const Stage& stage : Line()) num_moments[stage.command] = CountCalls(workplace, stage);

  for (int kill = 0; kill < NumKills() && !HasFailure(); ++kill) {
    const Stage& stage = Line()[kill % Line().size()];
    const int round = kill / static_cast<int>(Line().size());
    workplace.Forget(stage);
    const bool has_old = random() % 2 == 0;
    if (has_old) {
      fs::copy(old.Build(stage.output), workplace.Build(stage.output), fs::copy_options::recursive);
    }
    // By turns at a named call and at any time.
    const double share = static_cast<double>(random() >> 11) / (uint64_t{1} << 53);
    const std::string moment =
        round % 2 == 0
            ? fmt::format("LC_KILL_AT_CALL={}", 1 + static_cast<int>(share * num_moments[stage.command]))
            : fmt::format("LC_KILL_AFTER_US={:.0f}", share * seconds[stage.command] * 1e6);
    SCOPED_TRACE(
        fmt::format("kill {}: {} {}{}", kill, stage.command, moment, has_old ? " over an old file" : ""));
    const ProgramRun killed = workplace.Compile(fmt::format(
        "setsid -w env LD_PRELOAD=" CAIRN_KILL_LIBRARY " LC_KILL_STAGE={} {}", stage.command, moment));
    if (killed.exit_code != 0) num_killed[stage.command]++;
    workplace.ExpectOnlyWholeFiles(has_old ? old_contents : Contents(), true);
    const ProgramRun run = workplace.Compile();
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(ContentsOf(workplace.folder()), workplace.clean());
  }
  int total = 0;
  for (const Stage& stage : Line()) {
    std::cout << stage.command << ": killed " << num_killed[stage.command] << " times, "
              << num_moments[stage.command] << " named moments\n";
    EXPECT_GT(num_moments[stage.command], 0);
    total += num_killed[stage.command];
  }
  std::cout << total << " kills\n";
  EXPECT_GE(2 * total, NumKills());
}

// A separate file system of a given size.
class SmallDisk {
 public:
  explicit SmallDisk(const std::string& path) : path_(path) {
    fs::create_directories(path_);
    is_mounted_ = mount("none", path_.c_str(), "tmpfs", 0, "size=1g") == 0;
  }
  ~SmallDisk() {
    if (is_mounted_) umount2(path_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool is_mounted() const { return is_mounted_; }
  // Leaves room for this many more bytes.
  bool LeaveRoom(uint64_t num_bytes) const {
    const fs::space_info space = fs::space(path_);
    const std::string size = fmt::format("size={}", space.capacity - space.free + num_bytes);
    return mount("none", path_.c_str(), "tmpfs", MS_REMOUNT, size.c_str()) == 0;
  }

 private:
  std::string path_;
  bool is_mounted_ = false;
};

uint64_t NumBytes(const fs::path& path) {
  if (fs::is_regular_file(path)) return fs::file_size(path);
  uint64_t num_bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file()) num_bytes += (entry.file_size() + 4095) / 4096 * 4096;
  }
  return num_bytes;
}

TEST(FullDisk, EveryStageSaysSoLeavesNothingBehindAndFinishesOnceThereIsRoom) {
  TemporaryFolder folder("full_disk_test");
  const SmallDisk disk(folder / "disk");
  if (!disk.is_mounted()) GTEST_SKIP() << "only root can mount a small tmpfs";
  const Workplace workplace(folder / "disk");
  std::mt19937_64 random(6);
  for (const Stage& stage : Line()) {
    const uint64_t size = NumBytes(workplace.Build(stage.output));
    workplace.Forget(stage);
    // Two blocks at least: one is for the message of the failing stage.
    ASSERT_TRUE(disk.LeaveRoom(4096 * (2 + random() % (size / 4096 - 2))));
    SCOPED_TRACE(stage.command);
    const ProgramRun full = workplace.Compile("", "--no-space-check");
    EXPECT_EQ(full.exit_code, static_cast<int>(ErrorCode::kDiskFull));
    EXPECT_THAT(full.err, AnyOf(HasSubstr("disk is full"), HasSubstr("No space left on device")));
    EXPECT_THAT(full.err, HasSubstr(workplace.folder()));
    workplace.ExpectOnlyWholeFiles({}, false);
    ASSERT_TRUE(disk.LeaveRoom(64 << 20));
    const ProgramRun run = workplace.Compile();
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(ContentsOf(workplace.folder()), workplace.clean());
  }
  // A long run is not even begun.
  workplace.Forget(Line()[1]);
  ASSERT_TRUE(disk.LeaveRoom(1 << 20));
  const ProgramRun refused = workplace.Compile();
  EXPECT_EQ(refused.exit_code, static_cast<int>(ErrorCode::kDiskFull));
  EXPECT_THAT(
      refused.err,
      ContainsRegex("the features of 88 images takes about [0-9]+ MB, but the disk has [0-9]+ MB left"));
}

// Starts `first`, stops the stage that it runs first while that one holds the folder, runs the others, and
// lets it end.
ProgramRun RunBeside(const std::string& folder, const std::string& first,
                     const std::vector<std::string>& others) {
  std::string script = fmt::format(
      "unset MAKEFLAGS MAKELEVEL; rm -f {0}/capture.stamp; {1} > {0}.out 2>&1 & until ls "
      "{0}/capture.stamp.tmp-*; do sleep "
      "0.01; done > {0}.ls 2> /dev/null; stage=$(pgrep -f '[-]-stamp {0}/capture.stamp'); kill -STOP "
      "$stage\n",
      folder, first);
  for (const std::string& other : others) script += other + " 2>&1; echo code $?\n";
  return RunShell(script + "kill -CONT $stage; wait $!; echo first $?");
}

TEST(Busy, SecondBuildOfAFolderIsRefusedWhoeverRunsIt) {
  TemporaryFolder folder("busy_test");
  WriteSmallRecipe(folder / "small.toml");
  const std::string build = folder / "small.build", map = folder / "small.cairn";
  const std::string compile = "cairn compile " + (folder / "small.toml") + " -o " + map + " --progress none";
  const std::string make = "make -f " CAIRN_MAP_RULES " CAIRN=" CAIRN_PROGRAM " PROGRESS=none BUILD=" + build;
  const std::string clean = "cairn clean " + map;
  for (const std::string& first : {compile, make}) {
    SCOPED_TRACE(first);
    const ProgramRun run = RunBeside(build, first, {compile, make, clean});
    EXPECT_THAT(run.out,
                ContainsRegex("another build \\(process [0-9]+@.*\\) is at work in this build folder"));
    EXPECT_THAT(run.out, ContainsRegex("code 9\n(.*\n)*code 2\n(.*\n)*code 9\n(.*\n)*first 0\n"));
    EXPECT_TRUE(fs::exists(map));
  }
}

TEST(Clean, RemovesWhatCairnMadeAndNothingElse) {
  TemporaryFolder folder("clean_test");
  const Workplace workplace(folder.string());
  const std::string map = folder / "small.cairn";
  // Only said, in a dry run.
  const ProgramRun dry = RunShell("cairn clean --dry-run --all " + map);
  EXPECT_EQ(dry.exit_code, 0) << dry.err;
  EXPECT_THAT(dry.out, ContainsRegex("would remove .*/small.build/capture/ \\([0-9]+ files, [0-9.]+ MB\\)"));
  EXPECT_THAT(dry.out, HasSubstr("would remove " + map));
  EXPECT_EQ(ContentsOf(folder.string()), workplace.clean());
  // Found by its recipe; somebody's own files stay.
  std::ofstream(workplace.Build("notes.txt")) << "mine";
  std::ofstream(workplace.Build("capture/images/holiday.jpg")) << "mine";
  const ProgramRun run = RunShell("cairn clean " + (folder / "small.toml"));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("removed " + workplace.Build("features.db") + " ("));
  EXPECT_THAT(run.out, HasSubstr("kept " + workplace.Build("notes.txt") + ": not cairn's"));
  Contents left = ContentsOf(folder.string());
  EXPECT_EQ(left.size(), 5) << testing::PrintToString(left);
  for (const char* name : {"small.toml", "small.cairn", "small.report.json", "small.build/notes.txt",
                           "small.build/capture/images/holiday.jpg"}) {
    EXPECT_TRUE(left.contains(name)) << name;
  }
  // Nor is a file of somebody's that a build folder says is its map.
  const std::string config = workplace.Build("config.mk"), own = folder / "own.cairn";
  fs::create_directories(folder / "small.build");
  std::ofstream(own) << "mine";
  std::ofstream(config) << "#\nMAP := " << own << "\n";
  const ProgramRun all = RunShell("cairn clean --all " + (folder / "small.build"));
  EXPECT_EQ(all.exit_code, 0) << all.err;
  EXPECT_THAT(all.out, HasSubstr("kept " + own + ": not cairn's"));
  EXPECT_EQ(ReadFile(own).value(), "mine");
  fs::remove(own);
  // A folder that is not a build folder is not touched.
  EXPECT_EQ(RunShell("cairn clean " + (folder / "small.build")).exit_code, 2);
  fs::remove_all(folder / "small.build");
  // Without such files, nothing is left.
  ASSERT_EQ(workplace.Compile().exit_code, 0);
  EXPECT_EQ(RunShell("cairn clean --all " + map).exit_code, 0);
  left = ContentsOf(folder.string());
  EXPECT_EQ(left.size(), 1) << testing::PrintToString(left);
  EXPECT_FALSE(fs::exists(folder / "small.build"));
  EXPECT_EQ(RunShell("cairn clean " + map).exit_code, 3);
}

// The small line's stages by hand, from the files of a build to `out`.
std::vector<std::string> StageCommands(const Workplace& workplace, const std::string& out) {
  const auto command = [&](const std::string& words, const std::string& stage) {
    return fmt::format("cairn {} --options {} -o {} --progress none --log-level error --threads 8", words,
                       workplace.Build("options/" + stage + ".toml"), out);
  };
  const std::string capture = workplace.Build("capture");
  return {command("stage extract-features " + capture, "extract_features"),
          command("stage match-features " + workplace.Build("features.db") + " --capture " + capture,
                  "match_features"),
          command("stage group-classes " + workplace.Build("matches.db") + " --capture " + capture,
                  "group_classes"),
          command("stage filter-visibility " + workplace.Build("classes.db"), "filter_visibility"),
          command("stage decompose-regions " + workplace.Build("world.db"), "decompose_regions"),
          command("stage build-vocabulary " + workplace.Build("features.db"), "build_vocabulary"),
          command("stage link-appearance " + workplace.Build("matches.db"), "link_appearance"),
          command(fmt::format(
                      "stage emit-map --name small --matches {0}/matches.db --classes {0}/classes.db --world "
                      "{0}/world.db --regions {0}/regions.db --vocabulary {0}/vocabulary.db --appearance "
                      "{0}/appearance.db",
                      workplace.Build("")),
                  "emit_map")};
}

TEST(Memory, StagesFinishWithinAnHonestLimitAndRefuseAnImpossibleOne) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers take memory of their own";
#endif
  TemporaryFolder folder("memory_test");
  fs::create_directories(folder / "work");
  const Workplace workplace(folder / "work");
  for (const std::string& command : StageCommands(workplace, folder / "out")) {
    SCOPED_TRACE(command);
    // The writable memory of a process, stacks of threads included, stays within the given limit.
    const ProgramRun honest = RunShell("ulimit -d $((256 * 1024)); " + command + " --memory 256");
    EXPECT_EQ(honest.exit_code, 0) << honest.err;
    EXPECT_TRUE(fs::exists(folder / "out"));
    fs::remove(folder / "out");
    const ProgramRun refused = RunShell(command + " --memory 60");
    EXPECT_EQ(refused.exit_code, 24);
    EXPECT_THAT(refused.err, ContainsRegex("takes about [0-9]+ MiB of memory, but --memory allows 60"));
    // With less than the given limit, any failed allocation gives an error that names --memory, and no crash.
    // From 60 MiB on it fails in any of eight threads, among them in constructors of the codecs' libraries.
    for (const int limit_mib : {32, 48, 60, 64, 67, 69, 71, 74, 78, 84}) {
      const ProgramRun cut_short = RunShell(
          fmt::format("ulimit -d $(({} * 1024)); timeout -s KILL 60 {} --memory 4000", limit_mib, command));
      if (cut_short.exit_code != 0) {
        EXPECT_EQ(cut_short.exit_code, 24) << limit_mib << ": " << cut_short.err;
        EXPECT_THAT(cut_short.err, HasSubstr("--memory")) << limit_mib;
        EXPECT_FALSE(fs::exists(folder / "out")) << limit_mib << ": " << cut_short.err;
      }
      fs::remove(folder / "out");
    }
  }
}

TEST(Memory, GroupingThatFitsWithoutAdjustingPosesSaysSo) {
  TemporaryFolder folder("grouping_memory_test");
  fs::create_directories(folder / "work");
  const Workplace workplace(folder / "work");
  // Between what is needed without and with adjusting so few images: 0.8 and 1.6 bytes per byte beside the
  // program's 64 MiB.
  const auto memory_mib =
      static_cast<int>(64 + (fs::file_size(workplace.Build("matches.db")) * 1.2) / (1 << 20));
  const std::string command =
      fmt::format("cairn stage group-classes {} --capture {} -o {} --memory {}",
                  workplace.Build("matches.db"), workplace.Build("capture"), folder / "out", memory_mib);
  const ProgramRun refused = RunShell(command);
  EXPECT_EQ(refused.exit_code, 24);
  EXPECT_THAT(refused.err, HasSubstr("with --refine-poses never it fits"));
  const ProgramRun grouped = RunShell(command + " --refine-poses never");
  EXPECT_EQ(grouped.exit_code, 0) << grouped.err;
}

}  // namespace
}  // namespace cairn
