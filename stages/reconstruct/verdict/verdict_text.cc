#include "stages/reconstruct/verdict/verdict_text.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace cairn::reconstruct {
namespace {

constexpr size_t kMaxNumNamed = 3;

std::string Counted(int64_t num, const char* noun) {
  return fmt::format("{} {}{}", num, noun, num == 1 ? "" : "s");
}

// The first few of a list, and how many more there are.
std::string FirstOf(const std::vector<int>& indices, const std::function<std::string(int)>& text) {
  std::vector<std::string> named;
  for (size_t i = 0; i < std::min(indices.size(), kMaxNumNamed); ++i) named.push_back(text(indices[i]));
  if (indices.size() > kMaxNumNamed) named.push_back(fmt::format("{} more", indices.size() - kMaxNumNamed));
  return fmt::format("{}", fmt::join(named, ", "));
}

std::string Between(const Verdict& verdict, int image1, int image2) {
  return fmt::format("{} to {}", verdict.images[image1].name, verdict.images[image2].name);
}

std::string PartText(const SeparatePart& part) {
  return fmt::format("{} images ({} to {})", part.num_images, part.first, part.last);
}

size_t NumWeak(const Verdict& verdict) {
  return verdict.weak_links.size() + verdict.long_steps.size() + verdict.weak_images.size() +
         verdict.open_stretches.size();
}

std::string LoopsLine(const Verdict& verdict) {
  const auto [shortest, longest] =
      std::minmax_element(verdict.loops.begin(), verdict.loops.end(),
                          [](const LoopPair& a, const LoopPair& b) { return a.way < b.way; });
  const auto text = [&](const LoopPair& loop) {
    return fmt::format("{} ({}, which have {} points in common)", LengthText(verdict, loop.way),
                       Between(verdict, loop.image1, loop.image2), loop.num_points);
  };
  if (verdict.loops.size() == 1) return "a loop of " + text(*shortest);
  return fmt::format("{} loops, of {} to {}", verdict.loops.size(), text(*shortest), text(*longest));
}

// Where it is weakest, whether or not that is weak.
std::string WeakestLink(const Verdict& verdict) {
  const auto least =
      std::min_element(verdict.links.begin(), verdict.links.end(),
                       [](const ImageLink& a, const ImageLink& b) { return a.num_points < b.num_points; });
  return fmt::format(
      "weakest between {}, which {} join",
      fmt::format("{} and {}", verdict.images[least->image1].name, verdict.images[least->image2].name),
      Counted(least->num_points, "point"));
}

std::vector<int> AllOf(size_t num) {
  std::vector<int> indices(num);
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

void AddWeakLines(const Verdict& verdict, std::vector<std::string>* lines) {
  if (!verdict.open_stretches.empty()) {
    lines->push_back("in no loop, so that nothing bounds how far it is off: " +
                     FirstOf(AllOf(verdict.open_stretches.size()), [&](int s) {
                       const OpenStretch& stretch = verdict.open_stretches[s];
                       return fmt::format("{} ({})", Between(verdict, stretch.image1, stretch.image2),
                                          LengthText(verdict, stretch.length));
                     }));
  }
  if (verdict.weak_links.empty() && !verdict.links.empty()) lines->push_back(WeakestLink(verdict));
  if (!verdict.weak_links.empty()) {
    lines->push_back("few points join " + FirstOf(verdict.weak_links, [&](int l) {
                       const ImageLink& link = verdict.links[l];
                       return fmt::format("{} ({})", Between(verdict, link.image1, link.image2),
                                          link.num_points);
                     }));
  }
  if (!verdict.long_steps.empty()) {
    lines->push_back(
        fmt::format("beside the median step of {} long: ", LengthText(verdict, verdict.median_step)) +
        FirstOf(verdict.long_steps, [&](int l) {
          const ImageLink& link = verdict.links[l];
          return fmt::format(
              "{} ({}{})", Between(verdict, link.image1, link.image2), LengthText(verdict, link.length),
              link.num_missing > 0 ? fmt::format(", {} missing", Counted(link.num_missing, "image")) : "");
        }));
  }
  if (!verdict.weak_images.empty()) {
    lines->push_back("few points hold " + FirstOf(verdict.weak_images, [&](int i) {
                       return fmt::format("{} ({})", verdict.images[i].name, verdict.images[i].num_points);
                     }));
  }
}

std::string PartsLine(const Verdict& verdict) {
  std::vector<int> indices;
  for (size_t p = 0; p < verdict.parts.size(); ++p) indices.push_back(static_cast<int>(p));
  return "not joined with the rest: " + FirstOf(indices, [&](int p) { return PartText(verdict.parts[p]); });
}

std::string WalksLine(const Verdict& verdict) {
  std::vector<int> indices = AllOf(verdict.walks.size());
  // Those that least joins with the others first.
  std::stable_sort(indices.begin(), indices.end(), [&](int a, int b) {
    return verdict.walks[a].num_points_of_others < verdict.walks[b].num_points_of_others;
  });
  return "of folders: " + FirstOf(indices, [&](int w) {
           const Walk& walk = verdict.walks[w];
           return fmt::format("{}: {} of {} images, {} of others",
                              walk.folder.empty() ? "(none)" : walk.folder, walk.num_joined, walk.num_images,
                              Counted(walk.num_points_of_others, "point"));
         });
}

}  // namespace

std::string LengthText(const Verdict& verdict, double length) {
  return fmt::format("{:.{}f} {}", length, length < 1 ? 2 : 1, verdict.is_metric ? "m" : "units");
}

std::string WholeText(const Verdict& verdict) {
  const size_t num_joined = verdict.images.size();
  std::string text;
  if (verdict.is_whole()) {
    text = fmt::format("whole: all {} images are joined", num_joined);
  } else {
    text = fmt::format("not whole: {} of {} images are joined", num_joined, verdict.num_images());
    int num_in_parts = 0;
    for (const SeparatePart& part : verdict.parts) num_in_parts += part.num_images;
    const int num_in_none = verdict.num_images() - static_cast<int>(num_joined) - num_in_parts;
    if (num_in_parts > 0) {
      text += fmt::format(", {} in {}", num_in_parts,
                          Counted(static_cast<int64_t>(verdict.parts.size()), "separate part"));
    }
    if (num_in_none > 0) text += fmt::format(", {} to no other", num_in_none);
  }
  if (verdict.is_drive) {
    text += fmt::format("; a way of {}", LengthText(verdict, verdict.way));
    const bool is_tied = std::any_of(verdict.walks.begin(), verdict.walks.end(),
                                     [](const Walk& walk) { return walk.num_points_of_others > 0; });
    if (verdict.loops.size() == 1) {
      text += " that a loop holds together";
    } else if (!verdict.loops.empty()) {
      text += fmt::format(" that {} loops hold together", verdict.loops.size());
    } else if (!is_tied) {
      text += " that never comes back to what it has seen: nothing bounds how far its end is off";
    }
  }
  if (const size_t num_weak = NumWeak(verdict); num_weak > 0)
    text += fmt::format("; weak in {}", Counted(static_cast<int64_t>(num_weak), "place"));
  return text;
}

std::vector<std::string> VerdictLines(const Verdict& verdict) {
  std::vector<std::string> lines = {WholeText(verdict)};
  if (!verdict.loops.empty()) lines.push_back(LoopsLine(verdict));
  AddWeakLines(verdict, &lines);
  if (!verdict.parts.empty()) lines.push_back(PartsLine(verdict));
  if (verdict.walks.size() > 1) lines.push_back(WalksLine(verdict));
  return lines;
}

}  // namespace cairn::reconstruct
