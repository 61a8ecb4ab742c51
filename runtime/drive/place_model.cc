#include "runtime/drive/place_model.h"

#include <algorithm>
#include <utility>

#include "core/base/no_throw.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/features/features.h"
#include "core/vocabulary/document_scores.h"
#include "runtime/drive/route.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {

static_assert(PlaceModelOptions().score_exponent == kScoreExponent);

struct PlaceModel::Impl {
  std::vector<double> ImageScores(const BagOfWords& bag) const;  // 0 for images of no node
  PlaceScores OfNodes(const std::vector<double>& image_scores) const;

  std::shared_ptr<const AppearanceMap> appearance;
  std::vector<Pose> node_poses;
  Vocabulary vocabulary;  // documents: the map's images, by index
  std::vector<BagOfWords> bags;
  PlaceModelOptions options;
};

OptionTable DescribeOptions(PlaceModelOptions* options) {
  return {
      {.name = "score_exponent",
       .value = &options->score_exponent,
       .help =
           "probabilities are proportional to scores to this power; a larger one favours the best place more",
       .min = 1e-3,
       .max = 100}};
}

Result<PlaceModel> PlaceModel::Make(const Map& map, const PlaceModelOptions& options) {
  return WithoutExceptions("place model", [&]() -> Result<PlaceModel> {
    PlaceModelOptions checked = options;
    CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
    auto model = std::make_shared<Impl>();
    model->options = options;
    if (const DescriptorKind& kind = map.head().descriptor_kind; !kind.is_sift()) {
      return MakeError(ErrorCode::kUnsupported,
                       "map '{}' has descriptors of the kind '{}', and places are told apart by SIFT's",
                       map.head().name, ToString(kind));
    }
    CAIRN_ASSIGN_OR_RETURN(model->appearance, map.Appearance());
    if (model->appearance->is_kept.empty() || !map.has_words()) {
      return MakeError(
          ErrorCode::kNotFound,
          "map '{}' has {}: places cannot be told apart by looking; compile it with [emit_map] words = "
          "\"survey\"",
          map.head().name, map.has_words() ? "no appearance graph" : "no visual words");
    }
    CAIRN_ASSIGN_OR_RETURN(model->node_poses, NodePoses(map));
    CAIRN_ASSIGN_OR_RETURN(const auto tree, map.VocabularyTree());
    model->vocabulary = *tree;
    for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kWords); ++ordinal) {
      CAIRN_ASSIGN_OR_RETURN(const auto words, map.Words(ordinal));
      for (size_t i = 0; i < words->num_words(); ++i)
        model->vocabulary.inverted_files[words->first + i] = words->Postings(i);
    }
    model->vocabulary.document_ids.resize(map.num_images());
    for (size_t i = 0; i < model->vocabulary.document_ids.size(); ++i)
      model->vocabulary.document_ids[i] = static_cast<ImageId>(i);
    WeightVocabulary(&model->vocabulary);
    model->bags = DocumentWords(model->vocabulary);
    return PlaceModel(std::move(model));
  });
}

PlaceModel::PlaceModel(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

int PlaceModel::num_nodes() const { return static_cast<int>(impl_->appearance->is_kept.size()); }

const AppearanceMap& PlaceModel::appearance() const { return *impl_->appearance; }

const std::vector<Pose>& PlaceModel::node_poses() const { return impl_->node_poses; }

NodeIdx PlaceModel::NodeOfImage(int32_t image) const {
  const std::vector<NodeIdx>& nodes = impl_->appearance->node_of_image;
  return image < 0 || image >= static_cast<int32_t>(nodes.size()) ? -1 : nodes[image];
}

const std::vector<int32_t>& PlaceModel::ImagesOfNode(NodeIdx node) const {
  return impl_->appearance->node_images[node];
}

Result<PlaceView> ViewOfImage(const Map& map, int32_t image) {
  CAIRN_ASSIGN_OR_RETURN(const auto of_map, map.Image(image));
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, map.Gather(of_map->landmarks, true));
  PlaceView view;
  for (const MapLandmark& landmark : landmarks->landmarks)
    view.bearings.push_back((of_map->cam_from_world * landmark.position).normalized());
  view.packed = landmarks->packed;
  return view;
}

std::vector<double> PlaceModel::Impl::ImageScores(const BagOfWords& bag) const {
  std::vector<double> scores = ScoreDocuments(vocabulary, bag);
  for (size_t image = 0; image < scores.size(); ++image) {
    if (appearance->node_of_image[image] < 0) scores[image] = 0;
  }
  return scores;
}

PlaceScores PlaceModel::Impl::OfNodes(const std::vector<double>& scores) const {
  const std::vector<double> probabilities = ProbabilitiesOfScores(scores, options.score_exponent);
  const size_t num_nodes = appearance->is_kept.size();
  PlaceScores places{std::vector<double>(num_nodes, 0.0), std::vector<double>(num_nodes, 0.0)};
  double sum = 0;
  for (size_t image = 0; image < scores.size(); ++image) {
    const NodeIdx node = appearance->node_of_image[image];
    if (node < 0) continue;
    places.scores[node] = std::max(places.scores[node], scores[image]);
    places.probabilities[node] += probabilities[image];
    sum += probabilities[image];
  }
  for (double& p : places.probabilities) p /= sum;  // [Mariottini11 eq. 6] h = p(X | Z), of nodes
  return places;
}

PlaceScores PlaceModel::Look(const DescriptorMatrix& descriptors) const {
  return impl_->OfNodes(impl_->ImageScores(CountWords(impl_->vocabulary, descriptors)));
}

Result<PlaceScores> PlaceModel::LookCloser(const Map& map, const Query& query,
                                           const RerankOptions& options) const {
  return WithoutExceptions("place model", [&]() -> Result<PlaceScores> {
    const std::vector<double> by_words =
        impl_->ImageScores(CountWords(impl_->vocabulary, query.features.descriptors));
    const std::vector<int32_t> order = BestFirst(by_words);
    std::vector<PlaceView> views;
    for (const int32_t image : order) {
      if (by_words[image] <= 0 || static_cast<int>(views.size()) >= options.num_candidates) break;
      CAIRN_ASSIGN_OR_RETURN(PlaceView view, ViewOfImage(map, image));
      views.push_back(std::move(view));
    }
    std::vector<const PlaceView*> candidates;
    for (const PlaceView& view : views) candidates.push_back(&view);
    CAIRN_ASSIGN_OR_RETURN(const auto places,
                           RerankPlaces(MakePlaceView(query.features, query.camera), candidates, options, 1));
    if (places.empty() || !places.front().is_verified()) return impl_->OfNodes(by_words);
    std::vector<double> verified(by_words.size(), 0.0);
    for (const RerankedPlace& place : places) verified[order[place.candidate]] = place.score;
    return impl_->OfNodes(verified);
  });
}

std::vector<double> PlaceModel::Expected(NodeIdx node) const {
  // [Mariottini11 eq. 6] h' = p(X | Z of the node's own images), the mean where it has several
  const std::vector<int32_t>& images = impl_->appearance->node_images[node];
  std::vector<double> mean(num_nodes(), 0.0);
  for (const int32_t image : images) {
    const std::vector<double> probabilities =
        impl_->OfNodes(impl_->ImageScores(impl_->bags[image])).probabilities;
    for (size_t i = 0; i < mean.size(); ++i) mean[i] += probabilities[i] / static_cast<double>(images.size());
  }
  return mean;
}

}  // namespace cairn
