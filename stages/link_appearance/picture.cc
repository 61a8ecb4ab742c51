#include "stages/link_appearance/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>
#include <map>
#include <numeric>

#include <fmt/format.h>

#include "core/camera/panorama.h"
#include "core/geometry/pose.h"
#include "core/picture/floor_frame.h"
#include "core/picture/svg.h"

namespace cairn::link_appearance {
namespace {

constexpr const char* kKeptColour = kSvgBlue;
constexpr const char* kRestoredColour = kSvgVermilion;
constexpr double kLongSidePx = 1000, kMarginPx = 40, kTitlePx = 56, kLegendPx = 60;
// Largest cell of a matrix; with many nodes a cell is less than a pixel.
constexpr double kMaxCellPx = 12;

class Picture {
 public:
  explicit Picture(const Appearance& appearance) : appearance_(appearance) {}

  std::string OverFloor(const std::vector<std::optional<FloorPose>>& places) {
    SetView(places);
    Begin(width_px_, height_px_);
    DrawLinks();
    DrawNodes();
    DrawFloorLegend();
    return svg_.End();
  }

  // Rows in the order of the names, numbers in them by their values: as the images were taken.
  std::string AsMatrix(const std::vector<std::string>& names) {
    const int num_nodes = appearance_.graph.num_nodes();
    std::vector<NodeIdx> order(num_nodes);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](NodeIdx a, NodeIdx b) {
      return strverscmp(names[a].c_str(), names[b].c_str()) < 0;
    });
    row_.resize(num_nodes);
    for (int i = 0; i < num_nodes; ++i) row_[order[i]] = i;
    cell_px_ = std::min(kMaxCellPx, kLongSidePx / std::max(1, num_nodes));
    width_px_ = std::max(520.0, num_nodes * cell_px_ + 2 * kMarginPx);
    height_px_ = num_nodes * cell_px_ + kTitlePx + kMarginPx + kLegendPx;
    Begin(width_px_, height_px_);
    DrawMatrix();
    DrawMatrixLegend();
    return svg_.End();
  }

 private:
  bool IsKept(NodeIdx node) const { return appearance_.nodes[node].role != NodeRole::kDropped; }
  const char* Colour(NodeIdx node) const {
    return appearance_.nodes[node].role == NodeRole::kRestored ? kRestoredColour : kKeptColour;
  }

  void Begin(double width, double height) {
    svg_.Begin(width, height, 14);
    const size_t num_kept = appearance_.Kept().size();
    const int bound = appearance_.LowerBound();
    svg_.Write(
        "<text x=\"{:.0f}\" y=\"32\" font-size=\"18\"><tspan font-weight=\"bold\">{} of {} nodes "
        "kept</tspan>{}",
        kMarginPx, num_kept, appearance_.nodes.size(),
        bound > 0 ? fmt::format(", at least {} needed", bound) : std::string());
    svg_.Write("; {} links, {} component{}</text>\n", appearance_.graph.num_links(),
               appearance_.NumComponents(), appearance_.NumComponents() == 1 ? "" : "s");
  }

  // Chooses the scale and places all nodes that have one; nodes at one place move apart.
  void SetView(const std::vector<std::optional<FloorPose>>& places) {
    Eigen::Vector2d low(1e300, 1e300), high(-1e300, -1e300);
    std::map<std::pair<int64_t, int64_t>, int> num_at;  // decimetres
    const auto place_key = [](const Eigen::Vector2d& place) {
      return std::pair<int64_t, int64_t>(std::llround(place.x() * 10), std::llround(place.y() * 10));
    };
    for (const std::optional<FloorPose>& place : places) {
      if (!place) continue;
      low = low.cwiseMin(place->position);
      high = high.cwiseMax(place->position);
      ++num_at[place_key(place->position)];
    }
    const Eigen::Vector2d size = (high - low).cwiseMax(0.1);
    const double px_per_m = (kLongSidePx - 2 * kMarginPx) / size.maxCoeff();
    // Half of the distance to the nearest other place bounds marks.
    double nearest_m = size.maxCoeff();
    std::vector<Eigen::Vector2d> distinct;
    std::map<std::pair<int64_t, int64_t>, int> seen;
    for (const std::optional<FloorPose>& place : places) {
      if (place && seen.emplace(place_key(place->position), 1).second) distinct.push_back(place->position);
    }
    for (size_t i = 0; i < distinct.size(); ++i) {
      for (size_t k = i + 1; k < distinct.size() && k < i + 2000; ++k) {
        nearest_m = std::min(nearest_m, std::max(0.05, (distinct[i] - distinct[k]).norm()));
      }
    }
    radius_px_ = std::clamp(0.15 * nearest_m * px_per_m, 2.5, 9.0);
    const double spread_px = std::clamp(0.3 * nearest_m * px_per_m, 3.0, 16.0);
    for (const std::optional<FloorPose>& place : places) {
      if (!place) {
        pixels_.push_back(std::nullopt);
        continue;
      }
      Eigen::Vector2d pixel(kMarginPx + (place->position.x() - low.x()) * px_per_m,
                            kTitlePx + kMarginPx / 2 + (high.y() - place->position.y()) * px_per_m);
      if (num_at[place_key(place->position)] > 1) {
        const double heading = RadFromDeg(place->heading_deg);
        pixel += spread_px * Eigen::Vector2d(std::cos(heading), -std::sin(heading));
      }
      pixels_.push_back(pixel);
    }
    px_per_m_ = px_per_m;
    width_px_ = std::max(640.0, size.x() * px_per_m + 2 * kMarginPx);
    height_px_ = kTitlePx + size.y() * px_per_m + kMarginPx + kLegendPx;
  }

  // Per dropped node: the kept one that it has most inliers with; -1: none.
  std::vector<NodeIdx> Dominators() const {
    std::vector<NodeIdx> dominators(appearance_.nodes.size(), -1);
    for (NodeIdx node = 0; node < appearance_.graph.num_nodes(); ++node) {
      int32_t most = 0;
      for (const AppearanceGraph::Neighbour& n : appearance_.graph.Neighbours(node)) {
        if (IsKept(node) || !IsKept(n.node) || n.num_inliers <= most) continue;
        most = n.num_inliers;
        dominators[node] = n.node;
      }
    }
    return dominators;
  }

  // All links, paler where there are many; each dropped node's best link to a kept one; links of kept ones.
  void DrawLinks() {
    const std::vector<NodeIdx> dominators = Dominators();
    const double opacity =
        std::clamp(1500.0 / static_cast<double>(appearance_.graph.num_links() + 1), 0.03, 0.4);
    struct Layer {
      const char* id;
      const char* colour;
      double width, opacity;
    };
    enum { kOther, kDominating, kKept, kNumLayers };
    constexpr const char* kOtherColour = "#888888";
    const Layer layers[kNumLayers] = {{"links", kOtherColour, 0.5, opacity},
                                      {"dominating_links", kKeptColour, 0.8, 0.45},
                                      {"kept_links", kKeptColour, 2.2, 0.9}};
    for (int layer = 0; layer < kNumLayers; ++layer) {
      svg_.Write("<g id=\"{}\" stroke=\"{}\" stroke-width=\"{}\" stroke-opacity=\"{:.2f}\">\n",
                 layers[layer].id, layers[layer].colour, layers[layer].width, layers[layer].opacity);
      for (const AppearanceLink& link : appearance_.graph.Links()) {
        const bool dominates = dominators[link.node1] == link.node2 || dominators[link.node2] == link.node1;
        const bool both_kept = IsKept(link.node1) && IsKept(link.node2);
        if ((both_kept ? kKept : dominates ? kDominating : kOther) != layer) continue;
        if (!pixels_[link.node1] || !pixels_[link.node2]) continue;
        const Eigen::Vector2d &a = *pixels_[link.node1], &b = *pixels_[link.node2];
        svg_.Write("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n", a.x(), a.y(), b.x(), b.y());
      }
      svg_.Write("</g>\n");
    }
  }

  void DrawMark(double x, double y, NodeRole role) {
    if (role == NodeRole::kRestored) {
      svg_.Write("<rect x=\"{0:.1f}\" y=\"{1:.1f}\" width=\"{2:.1f}\" height=\"{2:.1f}\" fill=\"{3}\"/>\n",
                 x - radius_px_, y - radius_px_, 2 * radius_px_, kRestoredColour);
    } else {
      const bool kept = role == NodeRole::kDominating;
      svg_.Write("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" {}/>\n", x, y,
                 kept ? 1.3 * radius_px_ : 0.7 * radius_px_,
                 kept ? fmt::format("fill=\"{}\"", kKeptColour)
                      : std::string("fill=\"#ffffff\" stroke=\"#555555\" stroke-width=\"1\""));
    }
  }

  void DrawNodes() {
    svg_.Write("<g id=\"nodes\">\n");
    for (const bool kept : {false, true}) {
      for (size_t i = 0; i < appearance_.nodes.size(); ++i) {
        if (!pixels_[i] || IsKept(static_cast<NodeIdx>(i)) != kept) continue;
        DrawMark(pixels_[i]->x(), pixels_[i]->y(), appearance_.nodes[i].role);
      }
    }
    svg_.Write("</g>\n");
  }

  void DrawFloorLegend() {
    const double y = height_px_ - 24;
    svg_.Append(ScaleBar(kMarginPx, y - 6, px_per_m_, 140));
    radius_px_ = 5;
    double x = 270;
    const bool is_restored =
        std::any_of(appearance_.nodes.begin(), appearance_.nodes.end(),
                    [](const AppearanceNode& node) { return node.role == NodeRole::kRestored; });
    for (const auto& [role, label] :
         {std::pair(NodeRole::kDominating, "kept"), std::pair(NodeRole::kDropped, "dropped"),
          std::pair(NodeRole::kRestored, "kept for a cycle")}) {
      if (role == NodeRole::kRestored && !is_restored) continue;
      DrawMark(x, y, role);
      svg_.Write("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x + 12, y + 5, label);
      x += 95;
    }
    if (is_restored) x += 60;
    svg_.Write("<path d=\"M{0:.1f} {1:.1f}h24\" stroke=\"{2}\" stroke-width=\"0.8\" stroke-opacity=\"0.6\"/>",
               x - 6, y, kKeptColour);
    svg_.Write("<text x=\"{:.1f}\" y=\"{:.1f}\">located from there</text>\n", x + 24, y + 5);
  }

  double MatrixX(NodeIdx node) const { return kMarginPx + row_[node] * cell_px_; }
  double MatrixY(NodeIdx node) const { return kTitlePx + kMarginPx / 2 + row_[node] * cell_px_; }

  // [Booij06 Fig. 8]
  void DrawMatrix() {
    const int num_nodes = appearance_.graph.num_nodes();
    std::vector<int32_t> sorted;
    for (const AppearanceLink& link : appearance_.graph.Links()) sorted.push_back(link.num_inliers);
    std::sort(sorted.begin(), sorted.end());
    svg_.Write(
        "<rect x=\"{0:.1f}\" y=\"{1:.1f}\" width=\"{2:.1f}\" height=\"{2:.1f}\" fill=\"none\" "
        "stroke=\"#888888\"/>\n<g id=\"matrix\" shape-rendering=\"crispEdges\">\n",
        kMarginPx, kTitlePx + kMarginPx / 2, num_nodes * cell_px_);
    for (const AppearanceLink& link : appearance_.graph.Links()) {
      const bool both = IsKept(link.node1) && IsKept(link.node2);
      // Rank among all links: the darkest tenth is black.
      const auto rank = std::lower_bound(sorted.begin(), sorted.end(), link.num_inliers) - sorted.begin();
      const int gray = 190 - static_cast<int>(190 * rank / static_cast<int64_t>(sorted.size()));
      const std::string colour =
          both ? std::string(kRestoredColour) : fmt::format("#{0:02x}{0:02x}{0:02x}", gray);
      for (const auto& [row, column] :
           {std::pair(link.node1, link.node2), std::pair(link.node2, link.node1)}) {
        svg_.Write("<rect x=\"{0:.2f}\" y=\"{1:.2f}\" width=\"{2:.2f}\" height=\"{2:.2f}\" fill=\"{3}\"/>\n",
                   MatrixX(column), MatrixY(row), std::max(cell_px_, 1.0), colour);
      }
    }
    svg_.Write("</g>\n<g id=\"kept\">\n");
    for (const NodeIdx node : appearance_.Kept()) {
      const double thick = std::max(cell_px_, 2.0);
      svg_.Write("<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"10\" fill=\"{}\"/>\n",
                 MatrixX(node), kTitlePx + kMarginPx / 2 - 14, thick, Colour(node));
      svg_.Write("<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"10\" height=\"{:.2f}\" fill=\"{}\"/>\n",
                 kMarginPx - 14, MatrixY(node), thick, Colour(node));
    }
    svg_.Write("</g>\n");
  }

  void DrawMatrixLegend() {
    const double y = height_px_ - 22;
    svg_.Write(
        "<rect x=\"{0:.0f}\" y=\"{1:.0f}\" width=\"12\" height=\"12\" fill=\"#000000\"/><text x=\"{2:.0f}\" "
        "y=\"{3:.0f}\">linked (lighter: fewer inliers)</text>\n",
        kMarginPx, y - 10, kMarginPx + 18, y);
    svg_.Write(
        "<rect x=\"{0:.0f}\" y=\"{1:.0f}\" width=\"12\" height=\"12\" fill=\"{4}\"/><text x=\"{2:.0f}\" "
        "y=\"{3:.0f}\">both kept</text>\n",
        kMarginPx + 240, y - 10, kMarginPx + 258, y, kRestoredColour);
    svg_.Write(
        "<rect x=\"{0:.0f}\" y=\"{1:.0f}\" width=\"12\" height=\"12\" fill=\"{4}\"/><text x=\"{2:.0f}\" "
        "y=\"{3:.0f}\">kept</text>\n",
        kMarginPx + 350, y - 10, kMarginPx + 368, y, kKeptColour);
  }

  const Appearance& appearance_;
  double width_px_ = 0, height_px_ = 0, radius_px_ = 4, px_per_m_ = 1, cell_px_ = 1;
  std::vector<std::optional<Eigen::Vector2d>> pixels_;
  std::vector<int> row_;  // of the matrix, per node
  SvgWriter svg_;
};

}  // namespace

std::vector<std::string> NodeNames(const Appearance& appearance, const std::vector<DatabaseImage>& images) {
  std::map<ImageId, std::string> name_of;
  for (const DatabaseImage& image : images) name_of[image.image_id] = image.name;
  std::vector<std::string> names;
  for (const AppearanceNode& node : appearance.nodes) names.push_back(name_of[node.images.front()]);
  return names;
}

std::vector<std::optional<FloorPose>> NodePlaces(const Appearance& appearance,
                                                 const std::vector<DatabaseImage>& images,
                                                 const Capture& capture) {
  std::map<std::string, Pose> poses;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const CaptureImage& image : capture.images) {
    if (!image.cam_from_world) continue;
    poses.emplace(image.name, *image.cam_from_world);
    up -= image.cam_from_world->rotation.conjugate() * Eigen::Vector3d::UnitY();
  }
  Pose floor_from_world;
  if (up.norm() > 1e-9) floor_from_world.rotation.setFromTwoVectors(up, Eigen::Vector3d::UnitZ());
  std::map<ImageId, FloorPose> places;
  for (const DatabaseImage& image : images) {
    const std::optional<Pose> pose = FindPose(poses, image.name);
    if (pose) places.emplace(image.image_id, FloorPoseOf(*pose, floor_from_world));
  }
  std::vector<std::optional<FloorPose>> node_places;
  for (const AppearanceNode& node : appearance.nodes) {
    FloorPose mean{Eigen::Vector2d::Zero(), 0};
    int num_places = 0;
    for (const ImageId image : node.images) {
      const auto place = places.find(image);
      if (place == places.end()) continue;
      mean.position += place->second.position;
      mean.heading_deg = place->second.heading_deg;
      ++num_places;
    }
    if (num_places == 0) {
      node_places.push_back(std::nullopt);
    } else {
      mean.position /= num_places;
      node_places.push_back(mean);
    }
  }
  return node_places;
}

std::string DrawAppearance(const Appearance& appearance, const std::vector<std::string>& names,
                           const std::vector<std::optional<FloorPose>>& places) {
  const bool has_places =
      std::any_of(places.begin(), places.end(), [](const auto& place) { return place.has_value(); });
  Picture picture(appearance);
  return has_places ? picture.OverFloor(places) : picture.AsMatrix(names);
}

}  // namespace cairn::link_appearance
