#include "stages/build_vocabulary/command.h"

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/capture/capture.h"
#include "core/colmap/colmap_database.h"
#include "core/features/descriptor_kind_table.h"
#include "core/line/memory.h"
#include "stages/build_vocabulary/build_vocabulary.h"

namespace cairn::build_vocabulary {
namespace {

// Bytes of memory per byte of the input file.
constexpr double kMemoryPerFileByte = 1.5;

struct Arguments {
  std::string features_path;
  std::string capture_path;
  std::string output_path;
  BuildVocabularyOptions options;
  OptionArguments option_arguments;
};

// `survey`: names of the images to read; empty: all.
Result<std::vector<ImageDescriptors>> ReadDescriptors(const std::string& path,
                                                      const std::optional<std::set<std::string>>& survey,
                                                      DescriptorKind* kind) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
  return WithDatabaseErrors(path, [&]() -> Result<std::vector<ImageDescriptors>> {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> database_images, ReadDatabaseImages(database));
    CAIRN_ASSIGN_OR_RETURN(*kind, ReadDescriptorKind(database, path));
    std::vector<ImageDescriptors> images;
    for (const DatabaseImage& image : database_images) {
      if (survey && survey->count(image.name) == 0) continue;
      CAIRN_ASSIGN_OR_RETURN(DescriptorMatrix descriptors,
                             ReadDatabaseDescriptors(database, image.image_id, *kind));
      images.push_back({image.image_id, std::move(descriptors)});
    }
    return images;
  });
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  std::optional<std::set<std::string>> survey;
  if (!arguments.capture_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(arguments.capture_path));
    survey.emplace();
    for (const CaptureImage& image : capture.images) survey->insert(image.name);
  }
  CAIRN_RETURN_IF_ERROR(CheckMemoryForFile("learning the words", arguments.features_path, kMemoryPerFileByte,
                                           environment.memory_mib));
  DescriptorKind kind;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<ImageDescriptors> images,
                         ReadDescriptors(arguments.features_path, survey, &kind));
  std::optional<Vocabulary> tree;
  if (!arguments.options.tree_from.empty()) {
    CAIRN_ASSIGN_OR_RETURN(tree, ReadVocabulary(arguments.options.tree_from));
  }
  CAIRN_ASSIGN_OR_RETURN(
      const Vocabulary vocabulary,
      BuildVocabulary(images, kind, arguments.options, environment.seed, environment.num_threads,
                      *environment.progress, tree ? &*tree : nullptr));
  CAIRN_RETURN_IF_ERROR(WriteVocabulary(vocabulary, arguments.output_path));
  environment.report->in = {{"images", static_cast<int64_t>(images.size())}};
  environment.report->out = {{"words", vocabulary.num_words()}};
  *environment.out << fmt::format("build_vocabulary: {} words of depth {} over {} images\n",
                                  vocabulary.num_words(), vocabulary.depth, vocabulary.document_ids.size());
  return Ok();
}

}  // namespace

Command BuildVocabularyCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "build-vocabulary",
      .summary = "Learn the visual words of a survey, and which image shows which (stage 6)",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("features", arguments->features_path, "features.db").Required().Type("features.db");
            parser
                .Add("--capture", arguments->capture_path,
                     "Capture folder: only its survey images have words [all of features.db]")
                .Type("CAPTURE");
            parser.Add("-o,--output", arguments->output_path, "vocabulary.db to write")
                .Required()
                .Type("vocabulary.db");
            arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
      .may_be_output = {"--tree-from"},
  };
}

}  // namespace cairn::build_vocabulary
