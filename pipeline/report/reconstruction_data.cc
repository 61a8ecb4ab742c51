#include "pipeline/report/reconstruction_data.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "stages/reconstruct/verdict/verdict_text.h"

namespace cairn::pipeline {
namespace {

using Json = nlohmann::ordered_json;
using reconstruct::ImageLink;
using reconstruct::LengthText;
using reconstruct::LoopPair;
using reconstruct::Verdict;

constexpr size_t kMaxNumRows = 100, kMaxNumMissing = 1000, kMaxPrintedMissing = 60;

// What is weak, from which image to which (null: it is one image), and by what.
Json WeakJson(const Verdict& verdict) {
  Json list = Json::array();
  const auto add = [&](const char* what, int image1, int image2, const std::string& by) {
    if (list.size() >= kMaxNumRows) return;
    list.push_back(
        {what, verdict.images[image1].name, image2 < 0 ? Json() : Json(verdict.images[image2].name), by});
  };
  for (const reconstruct::OpenStretch& stretch : verdict.open_stretches)
    add("in no loop", stretch.image1, stretch.image2, LengthText(verdict, stretch.length));
  for (const int l : verdict.weak_links) {
    const ImageLink& link = verdict.links[l];
    add("few points join", link.image1, link.image2, fmt::format("{}", link.num_points));
  }
  for (const int l : verdict.long_steps) {
    const ImageLink& link = verdict.links[l];
    add("long step", link.image1, link.image2, LengthText(verdict, link.length));
  }
  for (const int i : verdict.weak_images)
    add("few points hold", i, -1, fmt::format("{}", verdict.images[i].num_points));
  return list;
}

// The longest first.
Json LoopsJson(const Verdict& verdict) {
  std::vector<LoopPair> loops = verdict.loops;
  std::stable_sort(loops.begin(), loops.end(),
                   [](const LoopPair& a, const LoopPair& b) { return a.way > b.way; });
  Json list = Json::array();
  for (size_t i = 0; i < std::min(loops.size(), kMaxNumRows); ++i) {
    list.push_back({LengthText(verdict, loops[i].way), verdict.images[loops[i].image1].name,
                    verdict.images[loops[i].image2].name, loops[i].num_points});
  }
  return list;
}

}  // namespace

bool IsReconstructionOf(const Verdict& verdict, const MapRows& rows) {
  if (!rows.frame.is_reconstructed) return false;
  std::set<std::string> joined;
  for (const reconstruct::JoinedImage& image : verdict.images) joined.insert(image.name);
  return std::all_of(rows.images.begin(), rows.images.end(),
                     [&](const MapImage& image) { return joined.count(image.name) > 0; });
}

Json ReconstructionJson(const Verdict& verdict) {
  Json json = {{"text", reconstruct::WholeText(verdict)},
               {"is_whole", verdict.is_whole()},
               {"num_joined", verdict.images.size()},
               {"num_images", verdict.num_images()},
               {"num_loops", verdict.loops.size()},
               {"loops", LoopsJson(verdict)},
               {"weak", WeakJson(verdict)},
               {"folders", Json::array()},
               {"parts", Json::array()},
               {"num_missing", verdict.missing.size()},
               {"missing", Json::array()}};
  if (verdict.walks.size() > 1) {
    for (size_t w = 0; w < std::min(verdict.walks.size(), kMaxNumRows); ++w) {
      const reconstruct::Walk& walk = verdict.walks[w];
      json["folders"].push_back({walk.folder, walk.num_joined, walk.num_images, walk.num_points_of_others});
    }
  }
  for (size_t p = 0; p < std::min(verdict.parts.size(), kMaxNumRows); ++p) {
    const reconstruct::SeparatePart& part = verdict.parts[p];
    json["parts"].push_back({part.num_images, part.first, part.last});
  }
  for (size_t m = 0; m < std::min(verdict.missing.size(), kMaxNumMissing); ++m)
    json["missing"].push_back({verdict.missing[m].name, verdict.missing[m].reason});
  return json;
}

std::string ReconstructionText(const Verdict& verdict) {
  std::string text;
  for (const std::string& line : reconstruct::VerdictLines(verdict)) text += line + "\n";
  for (size_t m = 0; m < std::min(verdict.missing.size(), kMaxPrintedMissing); ++m)
    text += fmt::format("missing {}: {}\n", verdict.missing[m].name, verdict.missing[m].reason);
  if (verdict.missing.size() > kMaxPrintedMissing)
    text += fmt::format("and {} more\n", verdict.missing.size() - kMaxPrintedMissing);
  return text;
}

}  // namespace cairn::pipeline
