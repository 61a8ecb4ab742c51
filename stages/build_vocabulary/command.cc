#include "stages/build_vocabulary/command.h"

#include <algorithm>
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

// Bytes of memory per byte of the input file: of a large one, words are kept and no descriptors but those
// that train the tree (bench/scale/README.md).
constexpr double kMemoryPerFileByte = 1.5, kMemoryPerLargeFileByte = 0.15, kFixedMemory = 250.0 * (1 << 20);

// And per descriptor that trains the tree.
constexpr double kMemoryPerTrainingDescriptor = 2.0 * kSiftDescriptorDim;

Status CheckMemoryForFeatures(const std::string& path, const BuildVocabularyOptions& options,
                              int64_t memory_mib) {
  return CheckMemoryForFile(
      "learning the words", path,
      [&](double file) {
        return std::min(kMemoryPerFileByte * file,
                        kMemoryPerLargeFileByte * file + kFixedMemory +
                            kMemoryPerTrainingDescriptor * options.max_num_training_descriptors);
      },
      memory_mib);
}

struct Arguments {
  std::string features_path;
  std::string capture_path;
  std::string output_path;
  BuildVocabularyOptions options;
  OptionArguments option_arguments;
};

// What the database has of the images of the survey; all, where there is none.
Result<DescriptorSource> OpenDescriptors(SQLite::Database& database, const DescriptorKind& kind,
                                         const std::optional<std::set<std::string>>& survey) {
  DescriptorSource source;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> images, ReadDatabaseImages(database));
  for (const DatabaseImage& image : images) {
    if (survey && survey->count(image.name) == 0) continue;
    CAIRN_ASSIGN_OR_RETURN(const int num_descriptors, ReadNumDescriptors(database, image.image_id));
    source.image_ids.push_back(image.image_id);
    source.num_descriptors.push_back(num_descriptors);
  }
  source.read = [&database, kind, ids = source.image_ids](size_t i) {
    return ReadDatabaseDescriptors(database, ids[i], kind);
  };
  return source;
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  std::optional<std::set<std::string>> survey;
  if (!arguments.capture_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(arguments.capture_path));
    survey.emplace();
    for (const CaptureImage& image : capture.images) survey->insert(image.name);
  }
  const std::string& path = arguments.features_path;
  CAIRN_RETURN_IF_ERROR(CheckMemoryForFeatures(path, arguments.options, environment.memory_mib));
  std::optional<Vocabulary> tree;
  if (!arguments.options.tree_from.empty()) {
    CAIRN_ASSIGN_OR_RETURN(tree, ReadVocabulary(arguments.options.tree_from));
  }
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
  CAIRN_ASSIGN_OR_RETURN(
      const Vocabulary vocabulary, WithDatabaseErrors(path, [&]() -> Result<Vocabulary> {
        CAIRN_ASSIGN_OR_RETURN(const DescriptorKind kind, ReadDescriptorKind(database, path));
        CAIRN_ASSIGN_OR_RETURN(const DescriptorSource images, OpenDescriptors(database, kind, survey));
        return BuildVocabulary(images, kind, arguments.options, environment.seed, environment.num_threads,
                               *environment.progress, tree ? &*tree : nullptr);
      }));
  CAIRN_RETURN_IF_ERROR(WriteVocabulary(vocabulary, arguments.output_path));
  environment.report->in = {{"images", std::ssize(vocabulary.document_ids)}};
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
