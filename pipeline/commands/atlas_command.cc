#include "pipeline/commands/commands.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/atlas/atlas_file.h"
#include "core/files/file.h"
#include "core/files/output_path.h"
#include "pipeline/atlas/make_atlas.h"
#include "pipeline/commands/in_atlas.h"

namespace cairn::pipeline {
namespace {

struct AtlasArguments {
  std::vector<std::string> map_paths;
  std::string output_path;
  std::string name;
  uint64_t epoch = 0;
  std::string key_path;
  std::string passages_path;
  MakeAtlasOptions options;
  OptionArguments option_arguments;
};

Status RunAtlas(const AtlasArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  std::optional<SecretKey> key;
  if (!arguments.key_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(key, ReadSecretKey(arguments.key_path));
  }
  CAIRN_RETURN_IF_ERROR(CheckCanBeReplaced(arguments.output_path));
  CAIRN_ASSIGN_OR_RETURN(AtlasRows atlas,
                         MakeAtlas(arguments.map_paths, arguments.output_path, arguments.passages_path,
                                   arguments.options, environment.num_threads, environment.progress));
  atlas.name =
      arguments.name.empty() ? std::filesystem::path(arguments.output_path).stem().string() : arguments.name;
  atlas.epoch = arguments.epoch;
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, EncodeAtlas(key, &atlas));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.output_path, bytes));
  return InspectAtlas(arguments.output_path, false, environment);
}

}  // namespace

Command AtlasCommand() {
  auto arguments = std::make_shared<AtlasArguments>();
  return {
      .name = "atlas",
      .summary = "Make one small index of many maps, by which a robot finds its map and its place",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("maps", arguments->map_paths, "Maps of a site; signed ones after they are signed")
                .Required()
                .Type("MAP");
            parser.Add("-o,--output", arguments->output_path, "Atlas to write").Required().Type("FILE.atlas");
            parser.Add("--name", arguments->name, "Name of the atlas [that of the file]").Type("NAME");
            parser
                .Add("--epoch", arguments->epoch,
                     "Number of its release, which a robot may ask to be no less than one that it knows [0]")
                .Type("N")
                .WholeNumber(0);
            parser.Add("--key", arguments->key_path, "Sign it with this key from keygen").Type("KEY");
            parser
                .Add("--passages", arguments->passages_path,
                     "Lifts, stairs and doors between maps: lines NAME, MAP/IMAGE, MAP/IMAGE[, COST], with "
                     "names of maps and survey images; COST as of so many links [1]")
                .Type("FILE");
            arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
          },
      .run = [arguments](const CommandEnvironment& environment) { return RunAtlas(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
