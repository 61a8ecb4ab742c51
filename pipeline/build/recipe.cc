#include "pipeline/build/recipe.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "core/options/toml_options.h"
#include "stages/simulate/read_recipe.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// Keys outside of the stages' tables, each with its line of the reference page.
struct Key {
  const char* name;
  const char* type;
  const char* help;
};
constexpr Key kTopKeys[] = {
    {"name", "text", "Name of the map: letters, digits, '-', '_' and '.'. Required."},
    {"seed", "integer", "Seed of everything random in the compile; at least 0. Default 0."},
};
constexpr Key kCaptureKeys[] = {
    {"name", "text",
     "Name of the session in the map, where there are several captures: letters, digits, '-', '_' and '.'. "
     "Default: the name of the folder."},
    {"path", "text",
     "Folder of the capture (images/, cameras.txt, images.txt), or a film, or a ROS bag (a file or folder), "
     "relative to the recipe. Required."},
    {"queries", "text",
     "Held-out images for the self-test, in the form of images.txt, relative to the recipe. Default: the "
     "capture's queries.txt, if there is one."},
    {"frame", "text",
     "Where there are several captures: \"shared\" (its poses are in the frame of the others; without poses "
     "it is "
     "registered to those that have some) or \"register\" (its poses are in a frame of its own, which is "
     "found from "
     "its images). Default \"shared\"."},
    {"floor_plan", "text",
     "Floor plan of the place (GeoJSON, DXF, the YAML file of a ROS map, or lines x0,y0,x1,y1 of walls), "
     "relative to the "
     "recipe: the map then has its walls, for robots with a laser ([floor plans](floor_plans.md)). One plan "
     "serves all "
     "captures. Default: none."},
    {"up", "text or list",
     "\"auto\" (the mean of the cameras' up), or the up direction in the capture's frame as [x, y, z]; the "
     "same for all captures that give one. Default \"auto\"."},
};

Error UnknownKey(const std::string& path, const toml::key& key, const std::string& what,
                 const std::vector<std::string>& valid) {
  const std::string name(key.str());
  const std::string nearest = NearestWord(name, valid);
  return MakeError(ErrorCode::kInvalidArgument, "{}:{}: unknown {} '{}'; {}", path, key.source().begin.line,
                   what, name,
                   nearest.empty() ? fmt::format("valid are {}", fmt::join(valid, ", "))
                                   : "did you mean '" + nearest + "'?");
}

const FootageKey* FindFootageKey(const std::string& name) {
  for (const FootageKey& key : FootageKeys()) {
    if (key.name == name) return &key;
  }
  return nullptr;
}

// A finite number, or a list of some; nothing for any other node.
std::optional<std::vector<double>> Numbers(const toml::node& node) {
  std::vector<double> numbers;
  const auto add = [&](const toml::node& item) {
    const std::optional<double> number = item.is_number() ? item.value<double>() : std::nullopt;
    if (number && std::isfinite(*number)) numbers.push_back(*number);
  };
  const toml::array* list = node.as_array();
  if (list == nullptr) add(node);
  for (size_t i = 0; list != nullptr && i < list->size(); ++i) add((*list)[i]);
  if (numbers.empty() || numbers.size() != (list == nullptr ? 1 : list->size())) return std::nullopt;
  return numbers;
}

Error WrongType(const std::string& path, const toml::node& node, const std::string& key,
                const char* expected) {
  return MakeError(ErrorCode::kInvalidArgument, "{}: {}: expected {}", TomlPlace(path, node), key, expected);
}

Status CheckName(const std::string& path, const toml::node& node, const std::string& name) {
  const bool valid = !name.empty() && name.size() <= 100 && name.front() != '.' && name.front() != '-' &&
                     std::all_of(name.begin(), name.end(), [](unsigned char c) {
                       return std::isalnum(c) || c == '-' || c == '_' || c == '.';
                     });
  if (valid) return Ok();
  return MakeError(
      ErrorCode::kInvalidArgument,
      "{}: name = '{}': must be 1 to 100 letters, digits, '-', '_' and '.', and not begin with '-' or '.'",
      TomlPlace(path, node), name);
}

constexpr Key kSimulateFloorPlanKey = {simulate::SimulatedFloorPlanKey::kName, "text",
                                       simulate::SimulatedFloorPlanKey::kHelp};

constexpr const char* kGateKeys[] = {"min_localized_ratio",        "min_precision_ratio",
                                     "min_region_localized_ratio", "min_region_precision_ratio",
                                     "min_region_held_out",        "plan_must_fit"};

// The keys of [gate]: those options of check_map that a map must reach to be written.
OptionTable GateOptions(const std::vector<StageOptions>& stages) {
  OptionTable gate;
  for (const StageOptions& stage : stages) {
    if (stage.stage != "check_map") continue;
    for (const Option& option : stage.table) {
      if (std::find(std::begin(kGateKeys), std::end(kGateKeys), option.name) != std::end(kGateKeys))
        gate.push_back(option);
    }
  }
  return gate;
}

// Reads the keys of one recipe file; a class only to keep the path and the recipe at hand.
class RecipeReader {
 public:
  RecipeReader(std::string path, std::vector<StageOptions> stages) : path_(std::move(path)) {
    recipe_.stages = std::move(stages);
  }

  Result<Recipe> Read() {
    CAIRN_ASSIGN_OR_RETURN(const toml::table document, ReadTomlFile(path_));
    for (const auto& [key, node] : document) CAIRN_RETURN_IF_ERROR(ReadTopKey(key, node));
    if (recipe_.name.empty()) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: no name; add a line such as name = \"kitchen\"",
                       path_);
    }
    if (recipe_.captures.empty() && !recipe_.simulated) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: no capture; add [[capture]] with path = \"FOLDER\", or [simulate] to render one",
                       path_);
    }
    if (!recipe_.captures.empty() && recipe_.simulated) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: has both [[capture]] and [simulate]; keep one of them", path_);
    }
    CAIRN_RETURN_IF_ERROR(PassUpOn());
    return recipe_;
  }

 private:
  // The capture's up direction is an option of the stage that lays out the floor.
  Status PassUpOn() {
    if (recipe_.up == "auto") return Ok();
    for (const StageOptions& stage : recipe_.stages) {
      if (stage.stage != "filter_visibility") continue;
      for (const Option& option : stage.table) {
        if (option.name != "up") continue;
        if (const std::string stated = OptionValueText(option); stated != "auto" && stated != recipe_.up) {
          return MakeError(
              ErrorCode::kInvalidArgument,
              "{}: up of a [[capture]] is {} and that of [filter_visibility] {}; keep one of them", path_,
              recipe_.up, stated);
        }
        return SetOption(option, recipe_.up);
      }
    }
    return Ok();
  }

  Status ReadTopKey(const toml::key& key, const toml::node& node) {
    const std::string name(key.str());
    if (name == "name") {
      CAIRN_ASSIGN_OR_RETURN(recipe_.name, Text(name, node));
      return CheckName(path_, node, recipe_.name);
    }
    if (name == "seed") return ReadSeed(node);
    if (name == "capture") return ReadCaptures(node);
    if (name == "gate" && node.is_table()) {
      return SetOptionsFromToml(*node.as_table(), path_, GateOptions(recipe_.stages));
    }
    const auto stage = std::find_if(recipe_.stages.begin(), recipe_.stages.end(),
                                    [&](const StageOptions& s) { return s.stage == name; });
    if (stage == recipe_.stages.end()) {
      std::vector<std::string> valid = {"name", "seed", "capture", "gate"};
      for (const StageOptions& s : recipe_.stages) valid.push_back(s.stage);
      return UnknownKey(path_, key, node.is_table() ? "table" : "key", valid);
    }
    if (!node.is_table()) return WrongType(path_, node, name, "a table of the stage's options");
    for (const auto& [option, value] : *node.as_table())
      recipe_.stage_keys.push_back({TomlPlace(path_, value), name, std::string(option.str())});
    if (name == "simulate") return ReadSimulate(*node.as_table(), stage->table);
    return SetOptionsFromToml(*node.as_table(), path_, stage->table);
  }

  Status ReadSimulate(const toml::table& table, OptionTable options) {
    recipe_.simulated = true;
    options.push_back({.name = kSimulateFloorPlanKey.name,
                       .value = &recipe_.simulated_floor_plan,
                       .help = kSimulateFloorPlanKey.help});
    CAIRN_RETURN_IF_ERROR(SetOptionsFromToml(table, path_, options));
    const toml::node* node = table.get(kSimulateFloorPlanKey.name);
    const fs::path file(recipe_.simulated_floor_plan);
    if (node == nullptr || (!file.empty() && !file.has_parent_path())) return Ok();
    return WrongType(path_, *node, "[simulate] floor_plan", "the name of a file of the rendered capture");
  }

  Status ReadSeed(const toml::node& node) {
    const auto* seed = node.as_integer();
    if (seed == nullptr || seed->get() < 0) return WrongType(path_, node, "seed", "an integer of at least 0");
    recipe_.seed = static_cast<uint64_t>(seed->get());
    return Ok();
  }

  Status ReadCaptures(const toml::node& node) {
    if (const toml::table* capture = node.as_table()) return ReadCaptureTable(*capture);
    const toml::array* captures = node.as_array();
    if (captures == nullptr || captures->empty() || !captures->is_homogeneous<toml::table>()) {
      return WrongType(path_, node, "capture", "a table: [[capture]] with path = \"FOLDER\"");
    }
    for (const toml::node& capture : *captures) CAIRN_RETURN_IF_ERROR(ReadCaptureTable(*capture.as_table()));
    return Ok();
  }

  Status ReadCaptureTable(const toml::table& table) {
    RecipeCapture capture;
    std::string up;
    std::vector<const FootageKey*> footage_keys;
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      if (name == "path") {
        CAIRN_ASSIGN_OR_RETURN(capture.path, ExistingPath(name, node));
      } else if (name == "name") {
        CAIRN_ASSIGN_OR_RETURN(capture.name, Text(name, node));
        CAIRN_RETURN_IF_ERROR(CheckName(path_, node, capture.name));
      } else if (name == "queries") {
        CAIRN_ASSIGN_OR_RETURN(capture.queries_path, ExistingPath(name, node));
      } else if (name == "frame") {
        CAIRN_ASSIGN_OR_RETURN(const std::string frame, Text(name, node));
        if (frame != "shared" && frame != "register")
          return WrongType(path_, node, "frame", "\"shared\" or \"register\"");
        capture.is_registered = frame == "register";
      } else if (name == "floor_plan") {
        CAIRN_ASSIGN_OR_RETURN(capture.floor_plan_path, ExistingPath(name, node));
      } else if (name == "up") {
        CAIRN_ASSIGN_OR_RETURN(up, UpDirection(node));
      } else if (const FootageKey* footage_key = FindFootageKey(name); footage_key != nullptr) {
        CAIRN_RETURN_IF_ERROR(ReadFootageKey(*footage_key, node, &capture.footage));
        footage_keys.push_back(footage_key);
      } else {
        std::vector<std::string> valid;
        for (const Key& k : kCaptureKeys) valid.emplace_back(k.name);
        for (const FootageKey& k : FootageKeys()) valid.emplace_back(k.name);
        return UnknownKey(path_, key, "key of [[capture]]", valid);
      }
    }
    if (capture.path.empty()) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: [[capture]] has no path; add path = \"FOLDER\"",
                       TomlPlace(path_, table));
    }
    capture.kind = KindOfCapture(capture.path);
    for (const FootageKey* key : footage_keys) {
      const Status status = CheckIsFor(*key, capture.kind, capture.path);
      if (!status.ok()) return AtPlace(table, status.error());
    }
    if (!up.empty() && up != "auto") {
      if (recipe_.up != "auto" && recipe_.up != up) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "{}: up differs from that of a capture above; all captures share one frame",
                         TomlPlace(path_, table));
      }
      recipe_.up = up;
    }
    for (const RecipeCapture& other : recipe_.captures) {
      if (capture.floor_plan_path.empty() || other.floor_plan_path.empty() ||
          other.floor_plan_path == capture.floor_plan_path)
        continue;
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: floor_plan differs from that of a capture above; a map has one plan, in the frame "
          "that all captures share: put the plans into one file",
          TomlPlace(path_, table));
    }
    return AddCapture(table, std::move(capture));
  }

  // Sessions are identified by their names.
  Status AddCapture(const toml::table& table, RecipeCapture capture) {
    const bool is_named = !capture.name.empty();
    if (!is_named) capture.name = NameOfFolder(capture.path);
    for (const RecipeCapture& other : recipe_.captures) {
      if (other.path == capture.path) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "{}: the folder {} is given twice; remove one [[capture]]", TomlPlace(path_, table),
                         capture.path);
      }
      if (other.name == capture.name) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "{}: two captures are named '{}'{}; give this one another, such as name = \"{}-2\"",
                         TomlPlace(path_, table), capture.name, is_named ? "" : " (the name of the folder)",
                         capture.name);
      }
    }
    recipe_.captures.push_back(std::move(capture));
    return Ok();
  }

  Result<std::string> Text(const std::string& key, const toml::node& node) const {
    if (const auto* text = node.as_string()) return text->get();
    return WrongType(path_, node, key, "a text in quotes");
  }

  Error AtPlace(const toml::node& node, const Error& error) const {
    return {error.code, fmt::format("{}: {}", TomlPlace(path_, node), error.message)};
  }

  Status ReadFootageKey(const FootageKey& key, const toml::node& node, FootageOptions* options) const {
    std::string text;
    const bool may_be_numbers = key.type != std::string("text");
    if (const std::optional<std::vector<double>> list = Numbers(node); may_be_numbers && list) {
      text = fmt::format("{}", fmt::join(*list, ","));
    } else {
      if (!node.is_string()) return WrongType(path_, node, key.name, key.type);
      text = node.as_string()->get();
    }
    const Status status = SetFootageOption(key, text, options);
    return status.ok() ? Ok() : Status(AtPlace(node, status.error()));
  }

  Result<std::string> ExistingPath(const std::string& key, const toml::node& node) const {
    CAIRN_ASSIGN_OR_RETURN(const std::string text, Text(key, node));
    const fs::path path = (fs::path(path_).parent_path() / text).lexically_normal();
    std::error_code error;
    if (!text.empty() && fs::exists(path, error)) return path.string();
    return MakeError(ErrorCode::kNotFound, "{}: {} = '{}': there is no {} (paths are relative to the recipe)",
                     TomlPlace(path_, node), key, text, path.string());
  }

  Result<std::string> UpDirection(const toml::node& node) const {
    if (const auto* text = node.as_string(); text != nullptr && text->get() == "auto") return text->get();
    const std::optional<std::vector<double>> up = node.is_array() ? Numbers(node) : std::nullopt;
    const bool valid = up && up->size() == 3 && ((*up)[0] != 0 || (*up)[1] != 0 || (*up)[2] != 0);
    if (!valid) return WrongType(path_, node, "up", "\"auto\" or three numbers [x, y, z] that are not all 0");
    return fmt::format("{}", fmt::join(*up, ","));
  }

  std::string path_;
  Recipe recipe_;
};

void AppendKeys(std::string* page, const auto& keys) {
  *page += "\n| key | type | meaning |\n|---|---|---|\n";
  for (const Key& key : keys) *page += fmt::format("| `{}` | {} | {} |\n", key.name, key.type, key.help);
}

std::string EscapePipes(std::string text) {
  for (size_t at = text.find('|'); at != std::string::npos; at = text.find('|', at + 2))
    text.insert(at, 1, '\\');
  return text;
}

void AppendOptions(std::string* page, const OptionTable& table) {
  if (table.empty()) {
    *page += "\nNo options.\n";
    return;
  }
  *page += "\n| key | default | range | meaning |\n|---|---|---|---|\n";
  for (const Option& option : table) {
    const std::string line = OptionsToml({option});  // "key = value\n"
    const std::string value = line.substr(option.name.size() + 3, line.size() - option.name.size() - 4);
    *page += fmt::format("| `{}` | `{}` | {} | {} |\n", option.name, value, EscapePipes(ValuesText(option)),
                         EscapePipes(option.help));
  }
}

}  // namespace

std::vector<std::string> UnreadKeys(const Recipe& recipe,
                                    const std::vector<std::pair<std::string, std::string>>& skipped) {
  std::vector<std::string> lines;
  for (const Recipe::Key& key : recipe.stage_keys) {
    const auto skip = std::find_if(skipped.begin(), skipped.end(),
                                   [&](const auto& stage) { return stage.first == key.stage; });
    if (skip != skipped.end()) {
      lines.push_back(
          fmt::format("{}: [{}] {} is not read: {}", key.place, key.stage, key.name, skip->second));
      continue;
    }
    for (const StageOptions& stage : recipe.stages) {
      if (stage.stage != key.stage) continue;
      for (const Option& option : stage.table) {
        if (option.name != key.name) continue;
        if (const Status status = CheckIsRead(option, stage.table); !status.ok())
          lines.push_back(fmt::format("{}: [{}] {}", key.place, key.stage, status.error().message));
      }
    }
  }
  return lines;
}

std::string NameOfFolder(const std::string& path) {
  fs::path folder(path);
  if (!folder.has_filename()) folder = folder.parent_path();
  std::error_code error;
  if (fs::is_regular_file(folder, error)) folder.replace_extension();
  std::string name = folder.filename().string().substr(0, 100);
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '_' && c != '.') c = '_';
  }
  if (name.empty() || name.front() == '.' || name.front() == '-') name = "capture";
  return name;
}

Result<Recipe> ReadRecipe(const std::string& path, std::vector<StageOptions> stages) {
  return RecipeReader(path, std::move(stages)).Read();
}

std::string RecipeReference(const std::vector<StageOptions>& stages) {
  std::string page =
      "# Recipes\n\n"
      "A recipe says what a map is compiled from and how. It is a TOML file; a name and a capture are "
      "enough:\n\n"
      "```toml\nname = \"kitchen\"\n[[capture]]\npath = \"captures/kitchen\"\n```\n\n"
      "Everything else has a default. A key that is not below is an error that names the nearest valid one.\n"
      "This page is written by `cairn manual`, from the options that the stages declare.\n\n"
      "## Top of the file\n";
  AppendKeys(&page, kTopKeys);
  page +=
      "\n## `[[capture]]`\n\nOne survey. Several of these tables are several sessions (cameras, days), in "
      "one "
      "frame or brought into one ([captures](captures.md)). A recipe has either this or `[simulate]`.\n";
  AppendKeys(&page, kCaptureKeys);
  for (const FootageKey& key : FootageKeys())
    page += fmt::format("| `{}` | {} | {} |\n", key.name, key.type, key.help);
  page += "\n## `[gate]`\n\nBelow these figures no map is written. They are options of `[check_map]`.\n";
  AppendOptions(&page, GateOptions(stages));
  for (const StageOptions& stage : stages) {
    page += fmt::format("\n## `[{}]`\n", stage.stage);
    if (stage.stage == "simulate")
      page += fmt::format(
          "\nThe capture is rendered first; an empty table takes all defaults. Besides the options below: "
          "`{}` ({}). {}\n",
          kSimulateFloorPlanKey.name, kSimulateFloorPlanKey.type, kSimulateFloorPlanKey.help);
    AppendOptions(&page, stage.table);
  }
  return page;
}

}  // namespace cairn::pipeline
