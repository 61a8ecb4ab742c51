#include "stages/emit_map/leave_out/choose_runs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "core/camera/panorama.h"
#include "core/promise/view_distance.h"

namespace cairn::emit_map {
namespace {

constexpr size_t kMaxRunLength = 12, kMinRunLength = 2;
constexpr size_t kRunsPerSurvey = 20;  // a run is at most one image in so many
constexpr double kAutoRatio = 0.1;
constexpr size_t kMinNumTried = 24, kMaxNumTried = 200;  // auto

size_t NumWanted(size_t num_images, const LeaveOutOptions& options) {
  const auto part = [&](double ratio) {
    return static_cast<size_t>(std::lround(ratio * static_cast<double>(num_images)));
  };
  if (options.hold_out != LeaveOutOptions::kAutoHoldOut) return std::max<size_t>(1, part(options.hold_out));
  return std::min(std::clamp(part(kAutoRatio), kMinNumTried, kMaxNumTried), num_images / 2);
}

// Of each image, the first of those that are views of one panorama; else itself.
std::vector<size_t> FirstOfPanorama(const std::vector<SurveyImage>& images) {
  std::map<std::string, size_t> first;
  std::vector<size_t> result;
  for (size_t i = 0; i < images.size(); ++i) {
    const auto view = ParsePanoramaViewName(images[i].name);
    result.push_back(view ? first.emplace(view->panorama_name, i).first->second : i);
  }
  return result;
}

// The images of the views of these images, and of the panoramas that these are of.
std::set<size_t> ViewsOf(const ViewDistance& distance, const std::vector<size_t>& panorama,
                         const std::vector<size_t>& run) {
  std::set<size_t> views;
  for (const size_t tried : run) {
    for (size_t image = 0; image < panorama.size(); ++image) {
      if (panorama[image] == panorama[tried] || distance.Squared(tried, image) < 1) views.insert(image);
    }
  }
  return views;
}

}  // namespace

OptionTable DescribeOptions(LeaveOutOptions* options) {
  return {{.name = "hold_out",
           .value = &options->hold_out,
           .help = "where a capture has no held-out images: part of the survey's images that try a map made "
                   "without them, in runs; 0: the map gets no self-test",
           .min = 0,
           .max = 0.5,
           .words = {{"auto", LeaveOutOptions::kAutoHoldOut}}}};
}

Result<LeftOutRuns> ChooseRuns(const Classes& classes, const LeaveOutOptions& options,
                               const std::set<size_t>& never_tried) {
  const size_t num_survey_images = classes.images.size();
  if (num_survey_images < kMinNumSurveyImages) {
    return MakeError(ErrorCode::kNoData,
                     "the survey has {} images with poses, and runs are left out of {} at least; take more, "
                     "or hold some out yourself (queries.txt)",
                     num_survey_images, kMinNumSurveyImages);
  }
  std::vector<size_t> may_be_tried;
  for (size_t image = 0; image < num_survey_images; ++image) {
    if (!never_tried.contains(image)) may_be_tried.push_back(image);
  }
  const size_t num_images = may_be_tried.size();
  if (num_images < kMinRunLength) {
    return MakeError(
        ErrorCode::kNoData,
        "{} of the survey's {} images are landmarks of an earlier map, in which it would recognise "
        "itself, or show what a later session shows as it is now, and a run has {} images at least; hold "
        "some "
        "out yourself (queries.txt)",
        num_survey_images - num_images, num_survey_images, kMinRunLength);
  }
  const size_t num_wanted = NumWanted(num_images, options);
  const size_t length =
      std::min(std::clamp(num_images / kRunsPerSurvey, kMinRunLength, kMaxRunLength), num_wanted);
  const size_t num_runs = (num_wanted + length / 2) / length;
  const ViewDistance distance(classes, {});
  const std::vector<size_t> panorama = FirstOfPanorama(classes.images);
  LeftOutRuns runs;
  LeftOutRounds rounds(num_survey_images);
  for (size_t run = 0; run < num_runs; ++run) {
    const size_t middle = (2 * run + 1) * num_images / (2 * num_runs);
    for (size_t shorter = length; shorter > 0; shorter /= 2) {
      const size_t begin = std::min(middle - std::min(middle, shorter / 2), num_images - shorter);
      const std::vector<size_t> tried(may_be_tried.begin() + static_cast<std::ptrdiff_t>(begin),
                                      may_be_tried.begin() + static_cast<std::ptrdiff_t>(begin + shorter));
      const std::set<size_t> views = ViewsOf(distance, panorama, tried);
      if (!rounds.MayLeaveOut(views)) continue;
      if (rounds.Add(tried, views)) ++runs.num_runs;
      break;
    }
  }
  if (runs.num_runs == 0) {
    return MakeError(ErrorCode::kNoData,
                     "each of the survey's {} images has more than a quarter of the others in its view, so "
                     "that a map without these is another one; survey more places, or hold some out yourself "
                     "(queries.txt)",
                     num_survey_images);
  }
  runs.rounds = rounds.Rounds();
  return runs;
}

}  // namespace cairn::emit_map
