// Where did I start?  A robot that was switched on anywhere is on its way to where the survey image GOAL was
// taken; these pictures it took on its way, one at each place.  start_cc MAP GOAL PICTURE.pgm...
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include "core/features/sift.h"
#include "pgm.h"
#include "runtime/drive/start_hypotheses.h"
#include "runtime/map/map.h"
#include "value_or_exit.h"

// What a picture says about where it was taken.
cairn::PlaceScores Look(const cairn::PlaceModel& model, const char* path) {
  int width = 0, height = 0;
  const std::unique_ptr<uint8_t, void (*)(void*)> pixels(ReadPgm(path, &width, &height), std::free);
  if (!pixels) std::fprintf(stderr, "%s is no 8-bit grey PGM file\n", path), std::exit(1);
  const cv::Mat image(height, width, CV_8UC1, pixels.get());
  return model.Look(ValueOrExit(cairn::ExtractSift(image, {})).descriptors);
}

// Of the survey image that stands for a place.
std::string NameOf(const cairn::Map& map, const cairn::PlaceModel& model, cairn::NodeIdx node) {
  return ValueOrExit(map.ImageName(model.ImagesOfNode(node).front()));
}

int main(int argc, char** argv) {
  if (argc < 4) return std::fprintf(stderr, "usage: start_cc MAP GOAL PICTURE.pgm... (8-bit grey)\n"), 2;

  const auto map = ValueOrExit(cairn::Map::Open(argv[1]));        // immutable, shared by all threads
  const auto model = ValueOrExit(cairn::PlaceModel::Make(*map));  // immutable, too
  const auto goal = model.NodeOfImage(ValueOrExit(cairn::FindImage(*map, argv[2])));
  auto starts = ValueOrExit(cairn::StartHypotheses::Make(model, Look(model, argv[3]), goal));
  for (int i = 3; i < argc; ++i) {
    // drive along starts.hypotheses()[starts.followed()].path.nodes; at every node:
    auto verdict = cairn::HypothesisVerdict::kFollow;
    if (i > 3) verdict = starts.Observe(Look(model, argv[i]));
    std::printf("%s", cairn::VerdictName(verdict));
    for (const cairn::StartHypothesis& start : starts.hypotheses())
      std::printf(" %s %.17g", NameOf(*map, model, start.start).c_str(), start.posterior);
    std::printf("\n");
    switch (verdict) {
      case cairn::HypothesisVerdict::kFollow:
        break;  // go on
      case cairn::HypothesisVerdict::kSwitch:
        break;  // another start leads: back, starts.Restart(), its way
      case cairn::HypothesisVerdict::kLost:
        return 0;  // carried away: localize again
    }
  }
  std::printf("way");
  for (const cairn::NodeIdx node : starts.hypotheses()[starts.followed()].path.nodes)
    std::printf(" %s", NameOf(*map, model, node).c_str());
  std::printf("\n");
}
