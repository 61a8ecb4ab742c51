#include "stages/match_features/partners_by_looks.h"

#include <string_view>

#include "core/features/hash_features.h"
#include "stages/match_features/image_step.h"

namespace cairn::match_features {
namespace {

// Hash of the tree that assigns words to descriptors.
ContentHash HashTree(const Vocabulary& vocabulary) {
  ContentHasher hasher;
  for (const VocabularyNode& node : vocabulary.nodes) hasher.UInt(node.num_children);
  hasher.Text({reinterpret_cast<const char*>(vocabulary.centres.data()),
               static_cast<size_t>(vocabulary.centres.size())});
  return hasher.Finish();
}

ImageStep WordsStep(const Vocabulary& vocabulary, MatchRun* run) {
  return {.name = "words",
          .key = [run, tree = HashTree(vocabulary)](int idx) -> Result<ContentHash> {
            CAIRN_ASSIGN_OR_RETURN(const DescriptorMatrix descriptors,
                                   ReadDatabaseDescriptors(run->features, run->images.images[idx].image_id,
                                                           run->images.descriptor_kind));
            return ContentHasher().Text("words").Hash(tree).Hash(HashFeatures({}, descriptors)).Finish();
          },
          .is_valid = [num_words = vocabulary.num_words()](
                          const std::vector<int>& words) { return AreBelow(words, num_words); },
          .compute =
              [run, &vocabulary](const std::vector<int>& idxs) {
                return QuantizeImages(run->features, run->images, idxs, vocabulary, run->num_threads,
                                      run->progress);
              }};
}

ImageStep PartnersStep(const LooksRule& rule, const std::vector<std::vector<WordIdx>>& words, int num_words) {
  ContentHasher hasher;
  hasher.Text("partners").Hash(rule.key).UInt(num_words);
  for (const std::vector<WordIdx>& image : words)
    hasher.Text({reinterpret_cast<const char*>(image.data()), image.size() * sizeof(WordIdx)});
  return {.name = "partners",
          .key = [all = hasher.Finish()](int idx) -> Result<ContentHash> {
            return ContentHasher().Hash(all).UInt(idx).Finish();
          },
          .is_valid = [num_images = static_cast<int>(words.size())](
                          const std::vector<int>& partners) { return AreBelow(partners, num_images); },
          .compute = [&rule, &words,
                      num_words](const std::vector<int>& idxs) -> Result<std::vector<std::vector<int>>> {
            return rule.partners(ImageSimilarity(words, num_words), idxs);
          }};
}

}  // namespace

Result<std::optional<std::vector<std::vector<int>>>> PartnersByLooks(const LooksRule& rule,
                                                                     SQLite::Database* database,
                                                                     MatchRun* run) {
  CAIRN_ASSIGN_OR_RETURN(const Vocabulary vocabulary,
                         VocabularyForRetrieval(run->features, run->images, run->inputs.vocabulary_path,
                                                run->seed, run->num_threads, run->progress));
  CAIRN_ASSIGN_OR_RETURN(const auto words, RunImageStep(WordsStep(vocabulary, run), database, run));
  if (!words) return std::optional<std::vector<std::vector<int>>>();
  return RunImageStep(PartnersStep(rule, *words, vocabulary.num_words()), database, run);
}

}  // namespace cairn::match_features
