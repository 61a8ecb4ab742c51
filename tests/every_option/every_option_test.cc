// Every option on every kind of capture: a map that opens and was tried, or a sentence that names the option.
//
// The options are those of the stages' tables, each with a value that follows from its table: a new option is
// tried without a line here, or asks for one (kGiven).  One build folder serves a kind, and only the recipe
// changes: what is left from one compile is what the next one begins with.  A compile sets one option of each
// stage; where it fails, each of them is tried alone.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/blocks/map_rows.h"
#include "core/capture/capture.h"
#include "core/files/file.h"
#include "pipeline/build/stage_options.h"
#include "tests/end_to_end/program_run.h"
#include "tests/pipeline/exchange/recorded_drive.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// A value of an option that a recipe sets.
struct Case {
  std::string stage;
  std::string name;
  std::string toml;  // the value
};

// Values where the table cannot tell which make sense; paths are relative to the capture, one to the recipe.
// clang-format off
const std::map<std::string, std::vector<std::string>> kGiven = {
    {"simulate.survey_area_m", {"[0.3, 0.3, 5.2, 5.6]"}},
    {"simulate.num_rooms", {"3"}},
    {"simulate.pose_noise_m", {"0.02"}},
    {"simulate.pose_noise_deg", {"0.5"}},
    {"simulate.num_queries", {"3", "0"}},
    {"extract_features.masks", {"\"../masks\""}},
    {"extract_features.model", {"\"none.onnx\""}},  // a real one: EndToEnd.OtherFeatures
    {"reconstruct.control_points", {"\"../control_points.txt\""}},
    {"reconstruct.distances", {"\"../distances.txt\""}},
    {"reconstruct.rig_baselines", {"\"../rig.txt\""}},
    {"reconstruct.hold_out_every", {"4"}},
    {"filter_visibility.up", {"\"0,0,1\""}},
    {"decompose_views.units", {"\"m\"", "\"mm\""}},
    {"decompose_views.layers", {"\"WALLS\""}},  // of a drawing: DxfPlan.LayersAreChosenByName
    {"build_vocabulary.tree_from", {"\"words.db\""}},
    {"emit_map.max_bytes", {"400000"}},
    {"emit_map.previous", {"\"before.cairn\""}},
};
// clang-format on

std::vector<std::string> ValuesOf(const std::string& stage, const Option& option) {
  const auto given = kGiven.find(stage + "." + option.name);
  if (given != kGiven.end()) return given->second;
  if (auto* const* flag = std::get_if<bool*>(&option.value)) return {**flag ? "false" : "true"};
  if (auto* const* integer = std::get_if<int*>(&option.value))
    return {fmt::format("{}", **integer + (**integer + 1 <= option.max ? 1 : -1))};
  if (auto* const* number = std::get_if<double*>(&option.value)) {
    double other = **number == 0 ? std::min(0.5, option.max) : 1.25 * **number;
    if (!(other <= option.max && other >= option.min)) other = 0.8 * **number;
    if (!(other <= option.max && other >= option.min)) other = option.max;
    return {fmt::format("{}", other)};
  }
  std::vector<std::string> values;
  for (const std::string& choice : option.choices) {
    if (choice != OptionValueText(option)) values.push_back("\"" + choice + "\"");
  }
  EXPECT_FALSE(values.empty()) << stage << "." << option.name
                               << ": the table does not say which value is another;"
                               << " give one in kGiven";
  return values;
}

// The values of all options of these stages, by stage.
std::map<std::string, std::vector<Case>> CasesOf(const std::set<std::string>& stages) {
  std::map<std::string, std::vector<Case>> cases;
  for (const StageOptions& stage : AllStageOptions()) {
    if (!stages.contains(stage.stage)) continue;
    for (const Option& option : stage.table) {
      for (const std::string& value : ValuesOf(stage.stage, option))
        cases[stage.stage].push_back({stage.stage, option.name, value});
    }
  }
  return cases;
}

// The options of each compile: one of each stage, and as many more of a stage as it takes for all to be tried
// in `max_num_compiles`.
std::vector<std::vector<Case>> Compiles(const std::map<std::string, std::vector<Case>>& cases,
                                        size_t max_num_compiles) {
  size_t num_compiles = 0;
  for (const auto& [stage, of_stage] : cases) num_compiles = std::max(num_compiles, of_stage.size());
  num_compiles = std::min(num_compiles, max_num_compiles);
  std::vector<std::vector<Case>> compiles(num_compiles);
  for (const auto& [stage, of_stage] : cases) {
    for (size_t i = 0; i < of_stage.size(); ++i) compiles[i % num_compiles].push_back(of_stage[i]);
  }
  return compiles;
}

// A stage's table of a recipe by key; later values replace earlier ones.
using Tables = std::map<std::string, std::map<std::string, std::string>>;

struct Kind {
  std::string name;
  std::string captures;  // the recipe without stages' options
  Tables base;           // what makes so small a capture a map
  // The stages whose options are tried: those for which this kind differs from the ones before it.
  std::set<std::string> stages;
  size_t max_num_compiles = 16;
};

void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

const std::set<std::string> kAfterPoses = {"group_classes",    "filter_visibility", "decompose_regions",
                                           "build_vocabulary", "link_appearance",   "emit_map",
                                           "leave_out",        "check_map"};

std::set<std::string> With(std::set<std::string> stages, const std::set<std::string>& more) {
  stages.insert(more.begin(), more.end());
  return stages;
}

Tables SmallStages(const Tables& more = {}) {
  Tables tables = {{"extract_features", {{"max_num_features", "300"}, {"contrast_threshold", "0.01"}}},
                   {"filter_visibility", {{"min_num_stations_driven", "2"}, {"cell_size_m", "0.7"}}},
                   {"decompose_regions", {{"k", "4"}, {"tau", "0"}}},
                   {"emit_map", {{"landmarks", "\"all\""}}}};
  for (const auto& [stage, keys] : more) {
    for (const auto& [key, value] : keys) tables[stage][key] = value;
  }
  return tables;
}

std::string OneCapture(const std::string& name, const std::string& more = "") {
  return "name = \"it\"\n[[capture]]\npath = \"" + name + "\"\n" + more;
}

const std::string kTinyPlace =
    "width_m = 5.5\ndepth_m = 6\nnum_rooms = 2\ntexel_m = 0.01\nimage_width_px = 240\nimage_height_px = "
    "180\n";

std::vector<Kind> Kinds() {
  const Tables fewest = {{"emit_map", {{"landmarks", "\"fewest\""}}}};
  return {
      {"Lattice", OneCapture("lattice"), SmallStages(fewest),
       With(kAfterPoses, {"extract_features", "match_features"})},
      // Held-out images and a floor plan: what reads them.
      {"QueriesAndPlan",
       OneCapture("queries", "floor_plan = \"queries/floor_plan.geojson\"\n"),
       SmallStages(),
       {"decompose_views", "leave_out", "check_map"}},
      // Poses along a way: stations are cells.
      {"Drive",
       OneCapture("drive"),
       SmallStages({{"emit_map", {{"visual_map", "true"}}}}),
       {"match_features", "group_classes", "filter_visibility", "decompose_regions", "emit_map"}},
      {"TwoCaptures",
       OneCapture("drive", "[[capture]]\npath = \"drive2\"\n"),
       SmallStages(),
       {"extract_features", "match_features", "link_appearance", "leave_out", "reconstruct"}},
      {"Panoramas",
       OneCapture("panoramas"),
       SmallStages(),
       {"extract_features", "match_features", "link_appearance", "leave_out"}},
      // Without poses, in the order of a drive: cameras are known, and so is what wheels say.
      {"Odometry",
       OneCapture("odometry"),
       SmallStages({{"reconstruct", {{"min_registered_ratio", "0.3"}}}}),
       {"extract_features", "match_features", "reconstruct", "group_classes", "build_vocabulary",
        "leave_out"}},
      // Images alone, in no order: COLMAP's mapper.
      {"Folder",
       OneCapture("folder"),
       SmallStages({{"reconstruct", {{"min_registered_ratio", "0.4"}}}}),
       {"reconstruct", "leave_out"}},
      {"TwoFolders",
       OneCapture("folder", "[[capture]]\npath = \"folder2\"\n"),
       SmallStages({{"reconstruct", {{"min_registered_ratio", "0.4"}}}}),
       {"reconstruct"},
       8},
      // Poses for the first alone: the other is registered to it.
      {"Registered",
       OneCapture("drive", "[[capture]]\npath = \"folder2\"\n"),
       SmallStages(),
       {"extract_features", "match_features", "reconstruct", "group_classes", "leave_out"},
       12},
      // Imported first: their images have names that the option's user has not seen.
      {"Film",
       OneCapture("walk.mp4", "keyframes = \"all\"\n"),
       SmallStages({{"reconstruct", {{"min_registered_ratio", "0.3"}}}}),
       {"extract_features", "match_features", "reconstruct"},
       8},
      {"Bag",
       OneCapture("run.db3", "keyframes = \"all\"\n"),
       SmallStages({{"reconstruct", {{"min_registered_ratio", "0.3"}}}}),
       {"extract_features", "reconstruct", "leave_out"},
       8},
      // Two cameras side by side.
      {"Rig",
       OneCapture("rig"),
       SmallStages({{"reconstruct", {{"min_registered_ratio", "0.3"}}}}),
       {"reconstruct", "leave_out"},
       8},
      {"Simulated",
       "name = \"it\"\n[simulate]\n" + kTinyPlace + "spacing_m = 1.4\nnum_queries = 2\n",
       SmallStages(),
       {"simulate", "leave_out"},
       12},
  };
}

// Images [first, first + num) of a capture as one of their own, with or without their poses.
void Slice(const std::string& from, const std::string& to, size_t first, size_t num, bool posed,
           const std::function<std::string(size_t)>& name_of = nullptr) {
  std::vector<Reject> rejects;
  std::vector<CaptureImage> images = *ReadImagesText(from + "/images.txt", &rejects);
  fs::create_directories(to + "/images");
  std::vector<CaptureImage> kept;
  for (size_t i = first; i < std::min(images.size(), first + num); ++i) {
    const std::string name = name_of ? name_of(i) : images[i].name;
    fs::copy_file(from + "/images/" + images[i].name, to + "/images/" + name);
    images[i].name = name;
    kept.push_back(images[i]);
  }
  if (!posed) return;
  fs::copy_file(from + "/cameras.txt", to + "/cameras.txt");
  ASSERT_TRUE(WriteImagesText(to + "/images.txt", kept).ok());
}

class EveryOption : public testing::TestWithParam<Kind> {
 protected:
  EveryOption() : folder_("every_option_" + GetParam().name) {}

  std::string Path(const std::string& name) const { return folder_ / name; }

  void Render(const std::string& name, const std::string& more) {
    std::ofstream(Path(name + ".sim.toml")) << kTinyPlace << more;
    const ProgramRun run = RunShell("cairn stage simulate " + Path(name + ".sim.toml") + " -o " + Path(name) +
                                    " --progress none");
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }

  void MakeCaptures() {
    const std::string& kind = GetParam().name;
    if (kind == "Lattice" || kind == "QueriesAndPlan") {
      Render("lattice", "spacing_m = 0.7\nsurvey_area_m = [0.3, 0.3, 2.6, 2.6]\nnum_queries = 4\n");
      fs::rename(Path("lattice"), Path("queries"));
      CopyCapture(Path("queries"), Path("lattice"), 20);
    } else if (kind == "Panoramas") {
      Render("rendered",
             "camera_model = \"EQUIRECTANGULAR\"\npanorama_width_px = 480\nspacing_m = 0.7\n"
             "survey_area_m = [0.3, 0.3, 2.6, 2.6]\nnum_queries = 0\n");
      Slice(Path("rendered"), Path("panoramas"), 0, 6, true);
    } else if (kind != "Simulated") {
      Render("rendered", "survey = \"driven\"\nstep_m = 0.25\nhorizontal_fov_deg = 65\nnum_queries = 0\n");
      const std::string rendered = Path("rendered");
      Slice(rendered, Path("drive"), 12, 18, true);
      Slice(rendered, Path("drive2"), 24, 14, true);
      Slice(rendered, Path("odometry"), 12, 20, false);
      fs::copy_file(rendered + "/cameras.txt", Path("odometry/cameras.txt"));
      WriteOdometry();
      const auto no_order = [](size_t i) {
        return fmt::format("{}.jpg", static_cast<char>('a' + 7 * i % 26));
      };
      Slice(rendered, Path("folder"), 12, 14, false, no_order);
      if (kind == "Registered") {  // pictures of its own: copies of the survey's are none
        Render("again",
               "survey = \"driven\"\nstep_m = 0.25\nhorizontal_fov_deg = 65\nnum_queries = 0\nrun = 1\n");
        Slice(Path("again"), Path("folder2"), 12, 12, false, no_order);
      } else {
        Slice(rendered, Path("folder2"), 20, 12, false, no_order);
      }
      WriteKnownPlaces("folder", 12, no_order);
      if (kind == "Odometry") WriteKnownPlaces("odometry", 12, nullptr);
      if (kind == "Rig") MakeRig();
      if (kind == "Film") MakeFilm();
      if (kind == "Bag") {
        WriteDb3(Path("run.db3"), RecordedDrive(*ReadCapture(rendered), 12, 32));
      }
    }
    for (const char* capture : {"lattice", "drive", "panoramas", "odometry"}) WriteMasks(capture);
  }

  // The right camera is where the left one is two steps later.
  void MakeRig() {
    const auto name_by_time = [](size_t first) {
      return [first](size_t i) { return fmt::format("{:02}.jpg", i - first); };
    };
    for (const auto& [side, first] : {std::pair("left", size_t{12}), std::pair("right", size_t{14})}) {
      Slice(Path("rendered"), Path("sides/") + side, first, 12, false, name_by_time(first));
      fs::create_directories(Path("rig/images"));
      fs::rename(Path("sides/") + side + "/images", Path("rig/images/") + side);
    }
    std::ofstream(Path("rig.txt")) << "left right 0.5\n";
  }

  void MakeFilm() {
    const ProgramRun run =
        RunShell("ffmpeg -v error -y -framerate 4 -start_number 13 -i " + Path("rendered") +
                 "/images/d%04d.jpg -frames:v 20 -c:v libx264 -pix_fmt yuv420p " + Path("walk.mp4"));
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }

  // World from camera, in the order of the drive.
  void WriteOdometry() {
    std::vector<Reject> rejects;
    const std::vector<CaptureImage> images = *ReadImagesText(Path("rendered/images.txt"), &rejects);
    std::ofstream odometry(Path("odometry/odometry.txt"));
    for (size_t i = 12; i < 32; ++i) {
      const Pose pose = images[i].cam_from_world->Inverse();
      odometry << fmt::format("{} {} {} {} {} {} {} {}\n", images[i].name, pose.translation.x(),
                              pose.translation.y(), pose.translation.z(), pose.rotation.x(),
                              pose.rotation.y(), pose.rotation.z(), pose.rotation.w());
    }
  }

  void WriteKnownPlaces(const std::string& capture, size_t first,
                        const std::function<std::string(size_t)>& name_of) {
    std::vector<Reject> rejects;
    const std::vector<CaptureImage> images = *ReadImagesText(Path("rendered/images.txt"), &rejects);
    const auto name = [&](size_t i) { return name_of ? name_of(i) : images[i].name; };
    const auto centre = [&](size_t i) { return images[i].cam_from_world->Center(); };
    std::ofstream points(Path("control_points.txt")), distances(Path("distances.txt"));
    for (size_t i = first; i < first + 12; i += 2)
      points << fmt::format("{} {} {} {}\n", name(i), centre(i).x(), centre(i).y(), centre(i).z());
    for (size_t i = first; i < first + 8; i += 2)
      distances << fmt::format("{} {} {}\n", name(i), name(i + 4), (centre(i) - centre(i + 4)).norm());
    ASSERT_TRUE(fs::exists(Path(capture)));
  }

  // All pixels but a border count.
  void WriteMasks(const std::string& capture) {
    if (!fs::exists(Path(capture + "/images"))) return;
    fs::create_directories(Path("masks"));
    for (const auto& entry : fs::directory_iterator(Path(capture + "/images"))) {
      cv::Mat mask = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
      mask.setTo(255);
      mask.rowRange(0, 4).setTo(0);
      cv::imwrite(Path("masks/" + entry.path().filename().string() + ".png"), mask);
    }
  }

  ProgramRun Compile(const std::vector<Case>& cases) {
    Tables tables = GetParam().base;
    for (const Case& one : cases) tables[one.stage][one.name] = one.toml;
    std::ofstream recipe(Path("it.toml"));
    recipe << GetParam().captures;
    for (const auto& [key, value] : tables["simulate"]) recipe << key << " = " << value << "\n";
    for (const auto& [stage, keys] : tables) {
      if (stage == "simulate") continue;
      recipe << "[" << stage << "]\n";
      for (const auto& [key, value] : keys) recipe << key << " = " << value << "\n";
    }
    recipe.close();
    ++num_compiles_;
    return RunShell("cairn compile " + Path("it.toml") + " -o " + Path("it.cairn") +
                    " --progress none --threads 1");
  }

  // Why a compile is neither a map that was tried nor a sentence about these options; empty: it is.
  std::string FaultOf(const ProgramRun& run, const std::vector<Case>& cases) {
    if (run.exit_code < 0 || run.exit_code >= 126) return fmt::format("exit code {}", run.exit_code);
    if (run.err.find("internal") != std::string::npos) return "an internal error";
    if (fs::exists(Path("it.cairn"))) {
      const Result<MapRows> rows = ReadMapRows(Path("it.cairn"));
      if (!rows.ok()) return "half a map: " + rows.error().message;
      const bool was_tried = !rows->self_test.empty() || run.out.find("self-test  ") != std::string::npos ||
                             cases.empty() || cases[0].stage == "leave_out";
      if (!rows->sealed || (run.exit_code == 0 && !was_tried)) return "a map that nothing tried";
    } else if (run.exit_code == 0) {
      return "no map";
    }
    if (run.exit_code == 0) return "";
    const bool is_named =
        std::any_of(cases.begin(), cases.end(), [&](const Case& one) { return IsNamed(run.err, one.name); });
    return is_named ? "" : "a message that does not name the option";
  }

  // Whether an error, not a warning, names an option.
  static bool IsNamed(const std::string& messages, const std::string& name) {
    std::istringstream lines(messages);
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with("warning") && line.find(name) != std::string::npos) return true;
    }
    return false;
  }

  TemporaryFolder folder_;
  int num_compiles_ = 0;
};

TEST_P(EveryOption, IsHonouredOrRefusedWithASentence) {
  ASSERT_NO_FATAL_FAILURE(MakeCaptures());
  const ProgramRun first = Compile({});
  ASSERT_EQ(first.exit_code, 0) << first.out << first.err;
  const std::string hash = *HashFile(Path("it.cairn"));
  fs::copy_file(Path("it.build/vocabulary.db"), Path("words.db"));
  fs::copy_file(Path("it.cairn"), Path("before.cairn"));
  int num_options = 0, num_refused = 0;
  for (const std::vector<Case>& together :
       Compiles(CasesOf(GetParam().stages), GetParam().max_num_compiles)) {
    num_options += static_cast<int>(together.size());
    // Those that a sentence names are refused; the others are tried again.
    std::vector<Case> left = together;
    ProgramRun run = Compile(left);
    while (run.exit_code != 0 && left.size() > 1 && FaultOf(run, left).empty()) {
      num_refused +=
          static_cast<int>(std::erase_if(left, [&](const Case& one) { return IsNamed(run.err, one.name); }));
      run = Compile(left);
    }
    if (FaultOf(run, left).empty()) continue;
    std::cout << "each alone: " << run.err.substr(0, run.err.find("\ncairn compile")) << "\n";
    for (const Case& one : left) {
      fs::remove(Path("it.cairn"));
      const ProgramRun alone = Compile({one});
      const std::string fault = FaultOf(alone, {one});
      num_refused += alone.exit_code == 0 ? 0 : 1;
      EXPECT_EQ(fault, "") << "[" << one.stage << "] " << one.name << " = " << one.toml << ": " << alone.err;
    }
  }
  const ProgramRun again = Compile({});
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(*HashFile(Path("it.cairn")), hash) << "not the bytes of the first compile";
  std::cout << fmt::format("{}: {} values of options in {} compiles, {} refused\n", GetParam().name,
                           num_options, num_compiles_, num_refused);
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryOption, testing::ValuesIn(Kinds()),
                         [](const testing::TestParamInfo<Kind>& info) { return info.param.name; });

// Each stage of a recipe is tried with some kind.
TEST(EveryStage, IsTriedWithAKind) {
  std::set<std::string> tried;
  for (const Kind& kind : Kinds()) tried.insert(kind.stages.begin(), kind.stages.end());
  for (const StageOptions& stage : AllStageOptions()) EXPECT_TRUE(tried.contains(stage.stage)) << stage.stage;
}

}  // namespace
}  // namespace cairn::pipeline
