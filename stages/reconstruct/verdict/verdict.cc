#include "stages/reconstruct/verdict/verdict.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "core/base/quantiles.h"
#include "core/base/text.h"
#include "core/structure/disjoint_sets.h"
#include "stages/reconstruct/verdict/seen_from_above.h"

namespace cairn::reconstruct {
namespace {

std::string FolderOf(const std::string& name) {
  const size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash);
}

// An image of the capture, joined or not.
struct ListedImage {
  std::string name;
  int of_model = -1;  // index into the kept model's; -1: it is missing
  int of_rejects = -1;
};

// In the order of names, each folder's together.
std::vector<std::vector<ListedImage>> ListByFolder(const ColmapModel& model,
                                                   const std::vector<Reject>& rejects) {
  std::vector<ListedImage> images;
  for (size_t i = 0; i < model.images.size(); ++i)
    images.push_back({.name = model.images[i].name, .of_model = static_cast<int>(i)});
  for (size_t i = 0; i < rejects.size(); ++i)
    images.push_back({.name = rejects[i].name, .of_rejects = static_cast<int>(i)});
  std::vector<std::string> names;
  for (const ListedImage& image : images) names.push_back(image.name);
  std::vector<std::vector<ListedImage>> folders;
  std::map<std::string, size_t> place;
  for (const int i : NaturalOrder(names)) {
    const size_t at = place.try_emplace(FolderOf(images[i].name), folders.size()).first->second;
    if (at == folders.size()) folders.emplace_back();
    folders[at].push_back(images[i]);
  }
  return folders;
}

// Beside long ones, steps this much shorter are none: frames are repeated, the camera stands or turns.
constexpr double kMovesRatio = 0.05;

// 0 where there is no step.
double MedianThatMoves(std::vector<double> steps) {
  if (steps.empty()) return 0;
  const double least = kMovesRatio * Decile(steps, 9);
  std::erase_if(steps, [&](double step) { return step < least; });
  return UpperMedian(std::move(steps));
}

void Round(double* length) { *length = std::round(1e5 * *length) / 1e5; }

class Judgement {
 public:
  Judgement(const JudgedModels& judged, const JudgeOptions& options)
      : judged_(judged), options_(options), folders_(ListByFolder(Kept(), judged.rejects)) {}

  Verdict Result() {
    verdict_.is_metric = judged_.is_metric;
    ListImages();
    const Covisibility covisibility(Kept(), order_);
    for (int i = 0; i < covisibility.num_images(); ++i)
      verdict_.images[i].num_points = covisibility.NumPoints(i);
    CountPointsOfOthers(covisibility);
    verdict_.is_drive = IsDrive(covisibility);
    if (verdict_.is_drive) {
      LinkNext(covisibility);
      MeasureWay(covisibility);
    } else {
      LinkMostCommon(covisibility);
    }
    FindWeak();
    FindParts();
    RoundLengths();
    return std::move(verdict_);
  }

 private:
  const ColmapModel& Kept() const { return judged_.models->front(); }

  // Fills images, missing and walks, and the order of the images.
  void ListImages() {
    for (const std::vector<ListedImage>& folder : folders_) {
      Walk& walk = verdict_.walks.emplace_back();
      walk.folder = FolderOf(folder[0].name);
      walk.num_images = static_cast<int>(folder.size());
      first_.push_back(static_cast<int>(order_.size()));
      const size_t first_missing = verdict_.missing.size();
      for (const ListedImage& image : folder) {
        const int last_joined = walk.num_joined > 0 ? static_cast<int>(order_.size()) - 1 : -1;
        if (image.of_model < 0) {
          verdict_.missing.push_back({.name = image.name,
                                      .reason = judged_.rejects[image.of_rejects].reason,
                                      .before = last_joined});
          continue;
        }
        ++walk.num_joined;
        order_.push_back(image.of_model);
        verdict_.images.push_back({.name = image.name});
        centres_.push_back(judged_.cam_from_world[image.of_model].Center());
        for (size_t m = first_missing; m < verdict_.missing.size(); ++m) {
          if (verdict_.missing[m].after < 0) verdict_.missing[m].after = static_cast<int>(order_.size()) - 1;
        }
      }
    }
    first_.push_back(static_cast<int>(order_.size()));
    const std::vector<Eigen::Vector2d> places = SeenFromAbove(centres_);
    for (size_t i = 0; i < places.size(); ++i) verdict_.images[i].place = places[i];
  }

  void CountPointsOfOthers(const Covisibility& covisibility) {
    for (size_t w = 0; w < verdict_.walks.size(); ++w)
      verdict_.walks[w].num_points_of_others = covisibility.NumCommonWithOthers(first_[w], first_[w + 1]);
  }

  bool IsDrive(const Covisibility& covisibility) const {
    std::vector<int> most(covisibility.num_images(), 0), next(covisibility.num_images(), 0);
    for (int i = 0; i < covisibility.num_images(); ++i) {
      for (const CommonPoints& other : covisibility.WithCommonPoints(i, 1)) {
        most[i] = std::max(most[i], other.num_points);
        if (other.image == i + 1) next[i] = other.num_points;
      }
    }
    int num_steps = 0, num_followed = 0;
    for (size_t w = 0; w + 1 < first_.size(); ++w) {
      for (int i = first_[w]; i + 1 < first_[w + 1]; ++i) {
        ++num_steps;
        const int least = std::min(most[i], most[i + 1]);
        if (least > 0 && next[i] >= options_.min_next_ratio * least) ++num_followed;
      }
    }
    return num_steps > 0 && num_followed >= options_.min_drive_ratio * num_steps;
  }

  void LinkNext(const Covisibility& covisibility) {
    std::vector<int> num_missing(order_.size(), 0);  // after each image
    for (const MissingImage& missing : verdict_.missing) {
      if (missing.before >= 0 && missing.after >= 0) ++num_missing[missing.before];
    }
    const int side = options_.num_images_of_side;
    for (size_t w = 0; w + 1 < first_.size(); ++w) {
      for (int i = first_[w]; i + 1 < first_[w + 1]; ++i) {
        const int num_points = covisibility.NumCommon(std::max(first_[w], i + 1 - side), i + 1, i + 1,
                                                      std::min(first_[w + 1], i + 1 + side));
        verdict_.links.push_back({.image1 = i,
                                  .image2 = i + 1,
                                  .num_points = num_points,
                                  .num_missing = num_missing[i],
                                  .length = Distance(i, i + 1)});
      }
    }
  }

  // Kruskal's maximum spanning tree.
  void LinkMostCommon(const Covisibility& covisibility) {
    for (int i = 0; i < covisibility.num_images(); ++i) {
      for (const CommonPoints& other : covisibility.WithCommonPoints(i, 1)) {
        if (other.image > i)
          verdict_.links.push_back({.image1 = i, .image2 = other.image, .num_points = other.num_points});
      }
    }
    std::stable_sort(verdict_.links.begin(), verdict_.links.end(),
                     [](const ImageLink& a, const ImageLink& b) { return a.num_points > b.num_points; });
    DisjointSets joined(covisibility.num_images());
    std::erase_if(verdict_.links, [&](ImageLink& link) {
      if (joined.Find(link.image1) == joined.Find(link.image2)) return true;
      joined.Join(link.image1, link.image2);
      link.length = Distance(link.image1, link.image2);
      return false;
    });
  }

  void MeasureWay(const Covisibility& covisibility) {
    std::vector<double> steps;
    for (const ImageLink& link : verdict_.links) steps.push_back(link.length);
    verdict_.way = std::accumulate(steps.begin(), steps.end(), 0.0);
    verdict_.median_step = MedianThatMoves(std::move(steps));
    for (size_t w = 0; w + 1 < first_.size(); ++w) {
      std::vector<double> way = {0};
      for (int i = first_[w] + 1; i < first_[w + 1]; ++i) way.push_back(way.back() + Distance(i - 1, i));
      const Loops loops = FindLoops(covisibility, first_[w], first_[w + 1], way, verdict_.median_step,
                                    TiedToOthers(covisibility, first_[w], first_[w + 1]), options_.loops);
      const auto append = [](const auto& from, auto* to) { to->insert(to->end(), from.begin(), from.end()); };
      append(loops.loops, &verdict_.loops);
      append(loops.pairs, &verdict_.loop_pairs);
      append(loops.open_stretches, &verdict_.open_stretches);
    }
    std::stable_sort(verdict_.open_stretches.begin(), verdict_.open_stretches.end(),
                     [](const OpenStretch& a, const OpenStretch& b) { return a.length > b.length; });
  }

  TiedImages TiedToOthers(const Covisibility& covisibility, int first, int end) const {
    std::vector<int> tied;
    for (int i = first; i < end; ++i) {
      for (const CommonPoints& other : covisibility.WithCommonPoints(i, options_.loops.min_num_points)) {
        if ((other.image < first || other.image >= end) && (tied.empty() || tied.back() != i))
          tied.push_back(i);
      }
    }
    return tied.empty() ? TiedImages() : TiedImages{tied.front(), tied.back()};
  }

  void FindWeak() {
    const auto sort_by = [](auto value, std::vector<int>* indices) {
      std::stable_sort(indices->begin(), indices->end(), [&](int a, int b) { return value(a) < value(b); });
    };
    const auto ratio = [&](int l) { return verdict_.links[l].length / (verdict_.links[l].num_missing + 1); };
    for (int l = 0; l < static_cast<int>(verdict_.links.size()); ++l) {
      if (verdict_.links[l].num_points < options_.min_link_points) verdict_.weak_links.push_back(l);
      if (verdict_.median_step > 0 && ratio(l) > options_.max_step_ratio * verdict_.median_step)
        verdict_.long_steps.push_back(l);
    }
    for (int i = 0; i < static_cast<int>(verdict_.images.size()); ++i) {
      if (verdict_.images[i].num_points < options_.min_image_points) verdict_.weak_images.push_back(i);
    }
    sort_by([&](int l) { return verdict_.links[l].num_points; }, &verdict_.weak_links);
    sort_by([&](int l) { return -ratio(l); }, &verdict_.long_steps);
    sort_by([&](int i) { return verdict_.images[i].num_points; }, &verdict_.weak_images);
  }

  void FindParts() {
    std::set<std::string> known;  // in the kept part, or in one before
    for (const JoinedImage& image : verdict_.images) known.insert(image.name);
    for (size_t m = 1; m < judged_.models->size(); ++m) {
      std::vector<std::string> names;
      for (const ModelImage& image : (*judged_.models)[m].images) {
        if (known.insert(image.name).second) names.push_back(image.name);
      }
      if (names.empty()) continue;
      const std::vector<int> order = NaturalOrder(names);
      verdict_.parts.push_back({static_cast<int>(names.size()), names[order.front()], names[order.back()]});
    }
    std::stable_sort(
        verdict_.parts.begin(), verdict_.parts.end(),
        [](const SeparatePart& a, const SeparatePart& b) { return a.num_images > b.num_images; });
  }

  void RoundLengths() {
    for (JoinedImage& image : verdict_.images) {
      Round(&image.place.x());
      Round(&image.place.y());
    }
    for (ImageLink& link : verdict_.links) Round(&link.length);
    for (std::vector<LoopPair>* loops : {&verdict_.loops, &verdict_.loop_pairs}) {
      for (LoopPair& loop : *loops) Round(&loop.way);
    }
    for (OpenStretch& stretch : verdict_.open_stretches) Round(&stretch.length);
    Round(&verdict_.way);
    Round(&verdict_.median_step);
  }

  double Distance(int a, int b) const { return (centres_[a] - centres_[b]).norm(); }

  const JudgedModels& judged_;
  const JudgeOptions& options_;
  std::vector<std::vector<ListedImage>> folders_;
  std::vector<int> order_;  // of each joined image its index in the kept model
  std::vector<int> first_;  // joined image of each walk; their number at the end
  std::vector<Eigen::Vector3d> centres_;
  Verdict verdict_;
};

}  // namespace

Verdict Judge(const JudgedModels& judged, const JudgeOptions& options) {
  return Judgement(judged, options).Result();
}

}  // namespace cairn::reconstruct
