#include "runtime/localize/retrieve.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <span>
#include <utility>

#include "core/base/pooled.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/features/descriptor_distance.h"
#include "core/features/descriptor_matcher.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "core/work/work_budget.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

// From a place to the box of a block's camera centres, metres.
double BoxDistance(const BlockEntry& entry, const Eigen::Vector3d& center) {
  return entry.centers.cast<double>().exteriorDistance(center);
}

// Blocks of images, those first whose box is nearest to a place: at least so far, block.
PooledVector<std::pair<double, int64_t>> ImageBlocksByDistance(const Map& map,
                                                               const Eigen::Vector3d& center) {
  PooledVector<std::pair<double, int64_t>> order;
  order.reserve(map.directory().NumBlocks(BlockKind::kImages));
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    order.emplace_back(BoxDistance(map.directory().Entry(BlockKind::kImages, ordinal), center), ordinal);
  }
  std::sort(order.begin(), order.end());
  return order;
}

// Images by q . d / (|q| |d|), best first, ties by image; those with a score near enough to the best one's.
PooledVector<Candidate> BestImages(std::span<const double> dots, double query_norm,
                                   const std::function<double(size_t)>& document_norm,
                                   const RetrieveOptions& options) {
  PooledVector<Candidate> scored;
  for (size_t image = 0; image < dots.size(); ++image) {
    if (dots[image] <= 0) continue;
    // As float, so that the last bits of a sum in another order do not decide.
    const auto score = static_cast<float>(std::min(1.0, dots[image] / (query_norm * document_norm(image))));
    scored.push_back({static_cast<int32_t>(image), score});
  }
  const size_t num_kept = std::min<size_t>(scored.size(), options.max_num_candidates);
  std::partial_sort(scored.begin(), scored.begin() + static_cast<std::ptrdiff_t>(num_kept), scored.end(),
                    [](const Candidate& a, const Candidate& b) {
                      return std::pair(-a.score, a.image) < std::pair(-b.score, b.image);
                    });
  scored.resize(num_kept);
  // [Mariottini11 fn 4] candidates exceed "a percentage of the maximum value"
  while (!scored.empty() && scored.back().score < options.min_score_ratio * scored.front().score)
    scored.pop_back();
  return scored;
}

// How many images are documents, and which ones where not all are.
struct Documents {
  double count = 0;
  std::shared_ptr<const AppearanceMap> kept;  // null: all images are
  bool Has(int64_t image) const {
    if (!kept) return true;
    const NodeIdx node = kept->node_of_image[image];
    return node >= 0 && kept->is_kept[node];
  }
};

Result<Documents> DocumentsOf(const Map& map) {
  Documents documents{.count = static_cast<double>(map.num_images())};
  if (map.head().documents == "all") return documents;
  CAIRN_ASSIGN_OR_RETURN(documents.kept, map.Appearance());
  documents.count = documents.kept->num_kept_images;
  return documents;
}

Result<PooledVector<Candidate>> RetrieveByVocabulary(const Map& map, const Query& query,
                                                     const RetrieveOptions& options) {
  const DescriptorMatrix& descriptors = query.features.descriptors;
  CAIRN_ASSIGN_OR_RETURN(const auto tree, map.VocabularyTree());
  CAIRN_ASSIGN_OR_RETURN(const auto norms, map.DocumentNorms());
  PooledVector<WordIdx> words(descriptors.rows());
  for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
    words[i] = QuantizeDescriptor(*tree, descriptors.row(i).data());
  }
  std::sort(words.begin(), words.end());

  // Sums over the words in ascending order: the same for any order of the descriptors.
  CAIRN_ASSIGN_OR_RETURN(const Documents documents, DocumentsOf(map));
  PooledVector<double> dots(map.num_images(), 0.0);
  double squared_norm = 0;
  if (!Spend(query.work.get(), Work::kPosting, map.num_images())) return PooledVector<Candidate>();
  std::shared_ptr<const WordBlock> block;
  for (size_t begin = 0, end = 0; begin < words.size(); begin = end) {
    const WordIdx word = words[begin];
    while (end < words.size() && words[end] == word) ++end;
    if (!block || word >= block->first + static_cast<int64_t>(block->num_words())) {
      CAIRN_ASSIGN_OR_RETURN(block, map.Words(map.directory().OrdinalOf(BlockKind::kWords, word)));
    }
    const size_t num_postings = block->NumPostings(word - block->first);
    if (num_postings == 0) continue;
    if (!Spend(query.work.get(), Work::kPosting, num_postings)) return PooledVector<Candidate>();
    // [Mariottini11 §IV] the query vector's entry, a word's count times its inverse document frequency
    const double idf = std::log(documents.count / static_cast<double>(num_postings));
    const double query_weight = static_cast<double>(end - begin) * idf;
    squared_norm += query_weight * query_weight;
    block->ForPostings(word - block->first, [&](const Posting& posting) {
      dots[posting.document] += query_weight * idf * posting.count;
    });
  }
  return BestImages(
      dots, std::sqrt(squared_norm), [&](size_t image) { return (*norms)[image]; }, options);
}

Result<PooledVector<Candidate>> RetrieveByLandmarks(const Map& map, const Query& query,
                                                    const RetrieveOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const auto all, map.AllLandmarks());
  PooledVector<BestTwo> nearest, unused;
  FindBestTwo(query.packed, all->packed, &nearest, &unused);
  const DescriptorSpace& space = query.packed.space();
  const double min_dot = DotAtAngle(options.max_word_angle_rad, space);
  PooledVector<int> counts(all->idx.size(), 0);
  for (const BestTwo& word : nearest) {
    if (word.idx < 0 || word.best < min_dot) continue;
    if (DescriptorAngleRad(word.best, space) <=
        options.max_word_ratio * DescriptorAngleRad(word.second, space))
      ++counts[word.idx];
  }
  CAIRN_ASSIGN_OR_RETURN(const Documents documents, DocumentsOf(map));
  // With the plus, a landmark that every image sees still counts: a map may have one image.
  PooledVector<double> idf(counts.size());
  double squared_norm = 0;
  for (size_t i = 0; i < idf.size(); ++i) {
    idf[i] = std::log((static_cast<double>(map.num_images()) + 1) /
                      std::max(1, all->landmarks[i].num_observations));
    squared_norm += counts[i] * idf[i] * counts[i] * idf[i];
  }
  PooledVector<double> dots(map.num_images(), 0.0), squared_norms(map.num_images(), 0.0);
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    for (size_t i = 0; i < block->images.size(); ++i) {
      if (!documents.Has(static_cast<int64_t>(block->first + i))) continue;
      for (const LandmarkIdx landmark : block->images[i].landmarks) {
        const double squared_idf = idf[landmark] * idf[landmark];
        dots[block->first + i] += counts[landmark] * squared_idf;
        squared_norms[block->first + i] += squared_idf;
      }
    }
  }
  return BestImages(
      dots, std::sqrt(squared_norm), [&](size_t image) { return std::sqrt(squared_norms[image]); }, options);
}

}  // namespace

OptionTable DescribeOptions(RetrieveOptions* o) {
  return {
      {.name = "max_num_candidates",
       .value = &o->max_num_candidates,
       .help = "most survey images to consider",
       .min = 1},
      {.name = "min_score_ratio",
       .value = &o->min_score_ratio,
       .help = "lowest score of a candidate, as part of the best one's",
       .min = 0,
       .max = 1},
      {.name = "max_word_angle_rad",
       .value = &o->max_word_angle_rad,
       .help =
           "without a vocabulary: largest angle of a descriptor and the landmark that is its word, radians",
       .min = 1e-3},
      {.name = "max_word_ratio",
       .value = &o->max_word_ratio,
       .help =
           "without a vocabulary: largest ratio of that angle to the angle to the second nearest landmark",
       .min = 1e-3,
       .max = 1},
      {.name = "max_num_regions",
       .value = &o->max_num_regions,
       .help = "most regions whose landmarks are matched first",
       .min = 1},
      {.name = "prior_distance_m",
       .value = &o->prior_distance_m,
       .help = "with a prior: largest distance of a candidate image from it, m",
       .min = 0},
      {.name = "prior_angle_deg",
       .value = &o->prior_angle_deg,
       .help = "with a prior: largest angle between a candidate image and it, degrees",
       .min = 0,
       .max = 180},
  };
}

PooledVector<int32_t> ImagesOf(std::span<const Candidate> candidates) {
  PooledVector<int32_t> images;
  images.reserve(candidates.size());
  for (const Candidate& candidate : candidates) images.push_back(candidate.image);
  return images;
}

Result<PooledVector<Candidate>> RetrieveByWords(const Map& map, const Query& query,
                                                const RetrieveOptions& options) {
  const size_t num_features = query.features.keypoints.size();
  const bool may = map.has_words() ? Spend(query.work.get(), Work::kWord, num_features)
                                   : Spend(query.work.get(), Work::kDescriptorPair,
                                           num_features * static_cast<size_t>(map.num_landmarks()));
  if (!may) return PooledVector<Candidate>();
  return map.has_words() ? RetrieveByVocabulary(map, query, options)
                         : RetrieveByLandmarks(map, query, options);
}

Result<PooledVector<Candidate>> RetrieveByPrior(const Map& map, const PosePrior& prior,
                                                const RetrieveOptions& options, WorkBudget* work) {
  const Pose cam_from_world = map.head().camera_from_given * prior.cam_from_world;
  const double max_distance = options.prior_distance_m + 3 * prior.sigma_m;
  const double max_angle = options.prior_angle_deg + 3 * prior.sigma_deg;
  PooledVector<Candidate> candidates;
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    if (BoxDistance(map.directory().Entry(BlockKind::kImages, ordinal), cam_from_world.Center()) >
        max_distance)
      continue;
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    if (!Spend(work, Work::kImage, block->images.size())) break;
    for (size_t i = 0; i < block->images.size(); ++i) {
      const Pose& survey = block->images[i].cam_from_world;
      const double distance = CenterErrorM(survey, cam_from_world);
      if (distance > max_distance || RotationErrorDeg(survey, cam_from_world) > max_angle) continue;
      candidates.push_back({block->first + static_cast<int32_t>(i), 1 / (1 + distance)});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::pair(-a.score, a.image) < std::pair(-b.score, b.image);
  });
  if (candidates.size() > static_cast<size_t>(options.max_num_candidates))
    candidates.resize(options.max_num_candidates);
  return candidates;
}

Result<PooledVector<NearView>> NearestViews(const Map& map, const Pose& cam_from_world, double radius_m,
                                            double radius_deg, int max_num, WorkBudget* work) {
  const Eigen::Vector3d center = cam_from_world.Center();
  PooledVector<NearView> nearest;  // ascending
  nearest.reserve(static_cast<size_t>(std::min<int64_t>(max_num, map.num_images())) + 1);
  const auto is_nearer = [](const NearView& a, const NearView& b) {
    return std::pair(a.squared_distance, a.image) < std::pair(b.squared_distance, b.image);
  };
  for (const auto& [least, ordinal] : ImageBlocksByDistance(map, center)) {
    const bool is_full = static_cast<int>(nearest.size()) == max_num;
    if (is_full && std::pow(least / radius_m, 2) > nearest.back().squared_distance) break;
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    if (!Spend(work, Work::kImage, block->images.size())) break;
    for (size_t i = 0; i < block->images.size(); ++i) {
      const Pose& survey = block->images[i].cam_from_world;
      const NearView view{block->first + static_cast<int32_t>(i),
                          std::pow(CenterErrorM(survey, cam_from_world) / radius_m, 2) +
                              std::pow(RotationErrorDeg(survey, cam_from_world) / radius_deg, 2)};
      nearest.insert(std::upper_bound(nearest.begin(), nearest.end(), view, is_nearer), view);
      if (static_cast<int>(nearest.size()) > max_num) nearest.pop_back();
    }
  }
  return nearest;
}

Result<int32_t> ImageNearFix(const Map& map, const Localization& found) {
  constexpr double kRadiusM = 1, kRadiusDeg = 15;
  const Pose& pose = found.has_fix() ? found.cam_from_world : found.possible_poses.front();
  CAIRN_ASSIGN_OR_RETURN(const auto near,
                         NearestViews(map, map.head().camera_from_given * pose, kRadiusM, kRadiusDeg, 1));
  return near.front().image;
}

Result<PooledVector<RegionIdx>> RegionsOfCandidates(const Map& map, std::span<const Candidate> candidates,
                                                    const RetrieveOptions& options) {
  PooledVector<std::pair<RegionIdx, double>> votes;  // ascending
  for (const Candidate& candidate : candidates) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(candidate.image));
    if (image->station < 0) continue;
    CAIRN_ASSIGN_OR_RETURN(const auto stations,
                           map.Stations(map.directory().OrdinalOf(BlockKind::kStations, image->station)));
    for (const RegionIdx region : stations->regions[image->station - stations->first]) {
      const auto at = std::lower_bound(votes.begin(), votes.end(), region,
                                       [](const auto& vote, RegionIdx value) { return vote.first < value; });
      if (at != votes.end() && at->first == region) {
        at->second += candidate.score;
      } else {
        votes.insert(at, {region, candidate.score});
      }
    }
  }
  std::sort(votes.begin(), votes.end(), [](const auto& a, const auto& b) {
    return std::pair(-a.second, a.first) < std::pair(-b.second, b.first);
  });
  PooledVector<RegionIdx> regions;
  for (const auto& [region, vote] : votes) {
    if (static_cast<int>(regions.size()) == options.max_num_regions) break;
    regions.push_back(region);
  }
  return regions;
}

Result<PooledVector<RegionVotes>> VotesForRegions(const Map& map, std::span<const LandmarkIdx> landmarks,
                                                  WorkBudget* work) {
  PooledVector<LandmarkIdx> ascending(landmarks.begin(), landmarks.end());
  std::sort(ascending.begin(), ascending.end());
  PooledVector<RegionVotes> votes;
  PooledVector<LandmarkIdx> of_block;
  for (auto first = ascending.begin(), end = first; first != ascending.end(); first = end) {
    CAIRN_ASSIGN_OR_RETURN(const auto block,
                           map.Landmarks(map.directory().OrdinalOf(BlockKind::kLandmarks, *first)));
    end = std::lower_bound(first, ascending.end(), block->first + std::ssize(block->landmarks));
    of_block.assign(first, end);
    // [Sala06 §III] a vote for each region that it belongs to
    for (const auto& [region, of_region] : block->regions) {
      if (!Spend(work, Work::kListed, of_region.size() + of_block.size())) return PooledVector<RegionVotes>();
      const int num_shared = NumShared(of_region, of_block);
      if (num_shared > 0) votes.push_back({region, num_shared});
    }
  }
  std::sort(votes.begin(), votes.end(),
            [](const RegionVotes& a, const RegionVotes& b) { return a.region < b.region; });
  size_t num_regions = 0;
  for (const RegionVotes& vote : votes) {
    if (num_regions > 0 && votes[num_regions - 1].region == vote.region) {
      votes[num_regions - 1].num_votes += vote.num_votes;
    } else {
      votes[num_regions++] = vote;
    }
  }
  votes.resize(num_regions);
  std::sort(votes.begin(), votes.end(), [](const RegionVotes& a, const RegionVotes& b) {
    return std::pair(-a.num_votes, a.region) < std::pair(-b.num_votes, b.region);
  });
  return votes;
}

Result<RegionIdx> RegionWithMost(const Map& map, std::span<const LandmarkIdx> landmarks, WorkBudget* work) {
  CAIRN_ASSIGN_OR_RETURN(const PooledVector<RegionVotes> votes, VotesForRegions(map, landmarks, work));
  return votes.empty() ? -1 : votes.front().region;
}

Result<PooledVector<LandmarkIdx>> LandmarksOfRegions(const Map& map, std::span<const RegionIdx> regions,
                                                     WorkBudget* work) {
  PooledVector<LandmarkIdx> landmarks;
  for (const RegionIdx region : regions) {
    CAIRN_ASSIGN_OR_RETURN(const auto of_regions,
                           map.Regions(map.directory().OrdinalOf(BlockKind::kRegions, region)));
    for (const int32_t ordinal : of_regions->landmark_blocks[region - of_regions->first]) {
      CAIRN_ASSIGN_OR_RETURN(const auto block, map.Landmarks(ordinal));
      const auto found =
          std::lower_bound(block->regions.begin(), block->regions.end(), region,
                           [](const auto& list, RegionIdx value) { return list.first < value; });
      if (found == block->regions.end() || found->first != region) continue;
      if (!Spend(work, Work::kListed, found->second.size())) return PooledVector<LandmarkIdx>();
      landmarks.insert(landmarks.end(), found->second.begin(), found->second.end());
    }
  }
  SortUnique(&landmarks);
  return landmarks;
}

Result<PooledVector<LandmarkIdx>> LandmarksOfImages(const Map& map, std::span<const int32_t> images,
                                                    int64_t max_num, WorkBudget* work) {
  PooledVector<LandmarkIdx> landmarks;
  for (const int32_t image : images) {
    CAIRN_ASSIGN_OR_RETURN(const auto row, map.Image(image));
    if (!landmarks.empty() && std::ssize(landmarks) + std::ssize(row->landmarks) > max_num) break;
    if (!Spend(work, Work::kListed, row->landmarks.size())) return PooledVector<LandmarkIdx>();
    landmarks.insert(landmarks.end(), row->landmarks.begin(), row->landmarks.end());
  }
  SortUnique(&landmarks);
  return landmarks;
}

Result<double> DistanceFromSurvey(const Map& map, const Eigen::Vector3d& center, WorkBudget* work) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [least, ordinal] : ImageBlocksByDistance(map, center)) {
    if (least >= nearest) break;
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    if (!Spend(work, Work::kImage, block->images.size())) break;
    for (const MapImage& image : block->images) {
      nearest = std::min(nearest, (image.cam_from_world.Center() - center).norm());
    }
  }
  return nearest;
}

}  // namespace cairn
