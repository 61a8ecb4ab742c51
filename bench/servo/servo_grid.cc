// servo_grid [PICTURE.svg]: the servo from a grid of start poses around a target in an empty room, with pixel
// noise and false matches, focal length exact and wrong by a fifth: share that arrives, steps, errors.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "core/base/parallel.h"
#include "core/geometry/pose.h"
#include "core/picture/svg.h"
#include "tests/runtime/drive/servo_scene.h"

namespace {

using namespace cairn;

constexpr double kToleranceM = 0.05, kToleranceDeg = 2;
constexpr int kMinNumCommon = 40, kMaxNumSteps = 400;

struct Run {
  PlanarPose start;
  std::vector<Eigen::Vector2d> way;
  ServoState end = ServoState::kTurning;
  std::string why;
  int num_steps = 0;
  double error_m = 0, error_deg = 0, way_m = 0, least_x_m = 0;
  bool Arrived() const {
    return end == ServoState::kArrived && error_m <= kToleranceM && error_deg <= kToleranceDeg;
  }
};

Run Drive(const ServoScene& scene, const Camera& assumed, const PlanarPose& start, uint64_t seed) {
  Run run;
  run.start = start;
  Random random(seed);
  const PlanarPose target;
  ServoOptions options;
  Servo servo = *Servo::Create(assumed, options);
  PlanarPose pose = start;
  run.way.push_back(pose.position);
  for (; run.num_steps < kMaxNumSteps; ++run.num_steps) {
    const ServoCommand command = servo.Step(scene.Match(pose, target, &random));
    run.end = command.state;
    run.why = command.why;
    if (command.state == ServoState::kArrived || command.state == ServoState::kLost) break;
    pose = Moved(pose, command.speed_m_s, command.turn_rad_s, options.step_s);
    run.way_m += (pose.position - run.way.back()).norm();
    run.way.push_back(pose.position);
    run.least_x_m = std::min(run.least_x_m, pose.position.x());
  }
  run.error_m = pose.position.norm();
  run.error_deg = std::abs(DegFromRad(pose.heading_rad));
  return run;
}

std::vector<PlanarPose> StartPoses(const ServoScene& scene) {
  std::vector<PlanarPose> starts;
  Random random(0);
  for (double x = -2.5; x <= 1.51; x += 0.5) {
    for (double y = -1.5; y <= 1.51; y += 0.25) {
      for (double degrees = -60; degrees <= 60.1; degrees += 10) {
        const PlanarPose start{{x, y}, RadFromDeg(degrees)};
        if (scene.Match(start, {}, &random).size() >= kMinNumCommon) starts.push_back(start);
      }
    }
  }
  return starts;
}

double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

// One panel per start heading: paths from the starts with it; arrows in the outcome's colour.
std::string Draw(const std::vector<Run>& runs) {
  constexpr double kPxPerM = 52, kLowX = -4.4, kHighX = 2.1, kHighY = 2.0;
  constexpr double kWidth = (kHighX - kLowX) * kPxPerM, kHeight = 2 * kHighY * kPxPerM;
  const std::vector<int> headings = {-40, -20, 0, 20, 40, 60};
  std::string svg = BeginSvg(3 * kWidth, 44 + 2 * kHeight + 30, 14);
  svg +=
      "<text x=\"16\" y=\"28\" font-size=\"18\" font-weight=\"bold\">Ways of the servo "
      "to a target image, by the heading at the start</text>\n";
  for (size_t panel = 0; panel < headings.size(); ++panel) {
    const double left = (panel % 3) * kWidth, top = 44 + (panel / 3) * kHeight;
    const auto pixel = [&](const Eigen::Vector2d& place) {
      return Eigen::Vector2d(left + (place.x() - kLowX) * kPxPerM, top + (kHighY - place.y()) * kPxPerM);
    };
    svg += fmt::format(
        "<rect x=\"{:.0f}\" y=\"{:.0f}\" width=\"{:.0f}\" height=\"{:.0f}\" fill=\"none\" "
        "stroke=\"#cccccc\"/>\n<text x=\"{:.0f}\" y=\"{:.0f}\">{:+d} degrees</text>\n",
        left, top, kWidth, kHeight, left + 8, top + 18, headings[panel]);
    const auto each = [&](auto&& draw) {
      for (const Run& run : runs) {
        if (std::abs(DegFromRad(run.start.heading_rad) - headings[panel]) < 1) draw(run);
      }
    };
    svg += "<g fill=\"none\" stroke=\"#888888\" stroke-width=\"0.6\">\n";
    each([&](const Run& run) {
      std::string points;
      Eigen::Vector2d last(1e9, 1e9);
      for (size_t i = 0; i < run.way.size(); ++i) {
        const Eigen::Vector2d p = pixel(run.way[i]);
        if ((p - last).norm() < 6 && i + 1 < run.way.size()) continue;
        points += fmt::format("{}{:.0f},{:.0f}", points.empty() ? "" : " ", p.x(), p.y());
        last = p;
      }
      svg += fmt::format("<polyline points=\"{}\"/>\n", points);
    });
    svg += "</g>\n";
    each([&](const Run& run) {
      const Eigen::Vector2d p = pixel(run.start.position);
      const double c = std::cos(run.start.heading_rad), s = -std::sin(run.start.heading_rad);
      svg += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} {:.1f}z\" fill=\"{}\"/>\n",
                         p.x() + 8 * c, p.y() + 8 * s, p.x() - 3 * s, p.y() + 3 * c, p.x() + 3 * s,
                         p.y() - 3 * c,
                         run.Arrived()                  ? "#0072B2"
                         : run.end == ServoState::kLost ? "#D55E00"
                                                        : "#E69F00");
    });
    const Eigen::Vector2d p = pixel({0, 0});
    svg += fmt::format("<path d=\"M{:.1f} {:.1f}l-6 5v-10z\" fill=\"#000000\"/>\n", p.x() + 6, p.y());
  }
  const double y = 44 + 2 * kHeight + 20;
  svg += fmt::format(
      "<text x=\"16\" y=\"{0:.0f}\">arrows: starts; <tspan fill=\"#0072B2\">arrived</tspan>, <tspan "
      "fill=\"#D55E00\">lost</tspan>, <tspan fill=\"#E69F00\">not within {1:g} cm and {2:g} degrees</tspan>; "
      "black: the target; the frame of a panel is {3:.1f} x {4:.1f} m</text>\n</svg>\n",
      y, 100 * kToleranceM, kToleranceDeg, kHighX - kLowX, 2 * kHighY);
  return svg;
}

}  // namespace

int main(int argc, char** argv) {
  ServoScene scene;
  scene.points = RoomPoints({-5, -3}, {5, 3}, 700, 1);
  const std::vector<PlanarPose> starts = StartPoses(scene);
  scene.noise_px = 0.5;
  scene.outlier_ratio = 0.2;
  std::printf("%zu start poses with at least %d common features\n", starts.size(), kMinNumCommon);
  std::printf(
      "focal  arrived  lost  elsewhere  steps p50 p90 p99  way_m p50 p90  cm p50 p90 max  deg p50 p90 max  "
      "least x\n");
  for (const double focal : {1.0, 0.8, 1.2}) {
    Camera assumed = scene.camera;
    assumed.params[0] *= focal;
    std::vector<Run> runs(starts.size());
    ParallelFor(static_cast<int64_t>(starts.size()), 0,
                [&](int64_t i) { runs[i] = Drive(scene, assumed, starts[i], MixSeed(2, i)); });
    int arrived = 0, lost = 0;
    std::vector<double> steps, way, cm, deg;
    double least_x = 0;
    for (const Run& run : runs) {
      if (!run.Arrived()) {
        lost += run.end == ServoState::kLost;
        if (std::getenv("SERVO_GRID_LIST") != nullptr) {
          std::printf("  x %.2f y %.2f heading %.0f: %s after %d steps, %.1f cm %.2f deg: %s\n",
                      run.start.position.x(), run.start.position.y(), DegFromRad(run.start.heading_rad),
                      ServoStateName(run.end), run.num_steps, 100 * run.error_m, run.error_deg,
                      run.why.c_str());
        }
        continue;
      }
      ++arrived;
      steps.push_back(run.num_steps);
      way.push_back(run.way_m);
      cm.push_back(100 * run.error_m);
      deg.push_back(run.error_deg);
      least_x = std::min(least_x, run.least_x_m);
    }
    std::printf(
        "%.1f  %d (%.2f %%)  %d  %d  %.0f %.0f %.0f  %.2f %.2f  %.2f %.2f %.2f  %.2f %.2f %.2f  %.2f\n",
        focal, arrived, 100.0 * arrived / static_cast<double>(runs.size()), lost,
        static_cast<int>(runs.size()) - arrived - lost, Percentile(steps, 0.5), Percentile(steps, 0.9),
        Percentile(steps, 0.99), Percentile(way, 0.5), Percentile(way, 0.9), Percentile(cm, 0.5),
        Percentile(cm, 0.9), Percentile(cm, 1), Percentile(deg, 0.5), Percentile(deg, 0.9),
        Percentile(deg, 1), least_x);
    std::fflush(stdout);
    if (argc > 1 && focal == 1.0) std::ofstream(argv[1]) << Draw(runs);
  }
  return 0;
}
