#include "sim/survey/survey.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <opencv2/core.hpp>

#include "core/base/random.h"
#include "sim/survey/drive.h"

namespace cairn::sim {
namespace {

// Number of random draws after which a free place counts as impossible.
constexpr int kMaxDraws = 20000;
// Queries lie between these distances from the nearest station, in units of the spacing (lattice) or
// metres (driven).
constexpr double kLeastOffset = 0.1, kGreatestOffset = 0.75;
constexpr double kGreatestDriveOffsetM = 0.3;
// Queries of a driven survey look along the drive up to this angle.
constexpr double kDriveHeadingDeg = 25;
// Largest motion of the image centre between two renderings of one exposure, pixels; the camera's way counts
// for a scene at this distance, metres.
constexpr double kBlurStepPx = 1;
constexpr double kBlurDistanceM = 1;

Pose RotatedInCamera(const Pose& cam_from_world, const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  if (angle == 0) return cam_from_world;
  const Pose turned{Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)), Eigen::Vector3d::Zero()};
  return turned * cam_from_world;
}

Pose AddPoseNoise(const Pose& cam_from_world, const SimulateOptions& options, Random& random) {
  const auto normal = [&](double sigma) {
    const double x = random.Normal(0, sigma), y = random.Normal(0, sigma), z = random.Normal(0, sigma);
    return Eigen::Vector3d(x, y, z);
  };
  const Eigen::Vector3d centre = cam_from_world.Center() + normal(options.pose_noise_m);
  Pose noisy = RotatedInCamera(cam_from_world, normal(RadFromDeg(options.pose_noise_deg)));
  noisy.translation = -(noisy.rotation * centre);
  return noisy;
}

int NumDigits(size_t count, int least) {
  int digits = 1;
  for (size_t n = count > 0 ? count - 1 : 0; n >= 10; n /= 10) ++digits;
  return std::max(digits, least);
}

// The part of the floor that is surveyed.
Rect SurveyArea(const Building& building, const SimulateOptions& options) {
  const std::vector<double>& area = options.survey_area_m;
  return area.empty() ? building.layout.bounds : Rect{area[0], area[1], area[2], area[3]};
}

bool IsInside(const Rect& rect, double x, double y) { return DistanceToRect(rect, x, y) == 0; }

std::vector<Eigen::Vector2d> LatticeStations(const Building& building, const SimulateOptions& options) {
  std::vector<Eigen::Vector2d> stations;
  const Rect& bounds = building.layout.bounds;
  const Rect area = SurveyArea(building, options);
  for (double y = bounds.y0 + options.spacing_m / 2; y < bounds.y1; y += options.spacing_m) {
    for (double x = bounds.x0 + options.spacing_m / 2; x < bounds.x1; x += options.spacing_m) {
      if (IsInside(area, x, y) && ClearanceM(building, x, y) >= options.clearance_m)
        stations.emplace_back(x, y);
    }
  }
  return stations;
}

// Index and distance of the station nearest to a place; ties to the smaller index.
std::pair<size_t, double> NearestStation(const std::vector<Eigen::Vector2d>& stations,
                                         const Eigen::Vector2d& place) {
  std::pair<size_t, double> nearest{0, std::numeric_limits<double>::infinity()};
  for (size_t s = 0; s < stations.size(); ++s) {
    const double distance = (stations[s] - place).norm();
    if (distance < nearest.second) nearest = {s, distance};
  }
  return nearest;
}

Status AddSurveyImages(const Building& building, const SimulateOptions& options, uint64_t seed,
                       std::vector<double>* headings, Survey* survey) {
  const bool lattice = options.survey == "lattice";
  if (lattice) {
    survey->stations = LatticeStations(building, options);
    if (survey->stations.empty()) {
      return MakeError(
          ErrorCode::kNoData,
          "no place for a station: no point of the lattice with spacing_m = {:g} keeps clearance_m = {:g} "
          "from walls and furniture; use a smaller spacing or clearance, or a larger building or "
          "survey_area_m",
          options.spacing_m, options.clearance_m);
    }
  } else {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DrivePose> drive, PlanDrive(building, options, seed));
    for (const DrivePose& pose : drive) {
      survey->stations.push_back(pose.position);
      headings->push_back(pose.heading_rad);
    }
  }
  const bool panoramas = survey->camera.model == CameraModel::kEquirectangular;
  const int num_headings = lattice && !panoramas ? options.num_headings : 1;
  const int digits = NumDigits(survey->stations.size(), lattice ? 3 : 4);
  const int heading_digits = NumDigits(num_headings, 1);
  for (size_t s = 0; s < survey->stations.size(); ++s) {
    Random random(MixSeed(MixSeed(seed, 10), s));
    for (int h = 0; h < num_headings; ++h) {
      PlannedImage image;
      image.name = lattice ? fmt::format("s{:0{}}_h{:0{}}.jpg", s, digits, h, heading_digits)
                           : fmt::format("d{:0{}}.jpg", s, digits);
      const double heading = lattice ? 2 * std::numbers::pi * h / num_headings : (*headings)[s];
      const Eigen::Vector2d& place = survey->stations[s];
      image.cam_from_world = MakePose({place.x(), place.y(), options.camera_height_m}, heading);
      image.stated_cam_from_world = AddPoseNoise(image.cam_from_world, options, random);
      image.noise = options.image_noise;
      image.gain = options.light_ratio;
      survey->images.push_back(image);
    }
  }
  return Ok();
}

Status AddQueries(const Building& building, const SimulateOptions& options, uint64_t seed,
                  const std::vector<double>& headings, Survey* survey) {
  const bool lattice = options.survey == "lattice";
  const double unit_m = lattice ? options.spacing_m : 1.0;
  const double greatest_m = lattice ? kGreatestOffset * options.spacing_m : kGreatestDriveOffsetM;
  const Rect bounds = lattice ? SurveyArea(building, options) : building.layout.bounds;
  const int digits = NumDigits(options.num_queries, 3);
  const double focal_px = survey->query_camera.MeanFocal();
  for (int q = 0; q < options.num_queries; ++q) {
    Random random(MixSeed(MixSeed(seed, 11), q));
    Eigen::Vector2d place;
    std::pair<size_t, double> nearest;
    int draws = 0;
    do {
      if (++draws > kMaxDraws) {
        return MakeError(
            ErrorCode::kNoData,
            "no place for query {}: {} random places are all nearer than clearance_m = {:g} to an obstacle "
            "or outside of the surveyed area; use a smaller clearance or num_queries = 0",
            q, kMaxDraws, options.clearance_m);
      }
      place.x() = random.Uniform(bounds.x0, bounds.x1);
      place.y() = random.Uniform(bounds.y0, bounds.y1);
      nearest = NearestStation(survey->stations, place);
    } while (nearest.second > greatest_m || (lattice && nearest.second < kLeastOffset * unit_m) ||
             ClearanceM(building, place.x(), place.y()) < options.clearance_m);
    PlannedImage image;
    image.name = fmt::format("q{:0{}}.jpg", q, digits);
    const double turns = random.Uniform();
    const bool surveyed = options.query_headings == "surveyed";
    const double heading =
        lattice ? 2 * std::numbers::pi *
                      (surveyed ? std::floor(turns * options.num_headings) / options.num_headings : turns)
                : headings[nearest.first] + RadFromDeg(2 * kDriveHeadingDeg * turns - kDriveHeadingDeg);
    const double pitch = RadFromDeg(random.Normal(0, options.query_tilt_deg));
    const double roll = RadFromDeg(random.Normal(0, options.query_tilt_deg));
    const double height = std::clamp(options.camera_height_m + random.Normal(0, options.query_height_m), 0.05,
                                     options.height_m - 0.05);
    image.cam_from_world = MakePose({place.x(), place.y(), height}, heading, pitch, roll);
    image.stated_cam_from_world = image.cam_from_world;
    image.noise = options.query_noise;
    image.gain = options.light_ratio * random.Uniform(1 - options.query_gain, 1 + options.query_gain);
    image.bias = random.Uniform(-options.query_bias, options.query_bias);
    const double blur_px = random.Uniform(0, options.query_blur_px);
    const double direction = random.Uniform(0, 2 * std::numbers::pi);
    image.turn = blur_px / focal_px * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0);
    survey->queries.push_back(image);
  }
  return Ok();
}

// Adds normal noise: the sum of the eight bytes of a random number is close to normal, and fast.
void AddGreyNoise(cv::Mat image, double sigma, uint64_t seed) {
  constexpr double kMean = 8 * 127.5, kSigma = 209.0;  // sqrt(8 (256^2 - 1) / 12)
  const float scale = static_cast<float>(sigma / kSigma),
              offset = static_cast<float>(-kMean * sigma / kSigma);
  uint64_t counter = 0;
  for (int y = 0; y < image.rows; ++y) {
    float* row = image.ptr<float>(y);
    for (int x = 0; x < image.cols; ++x) {
      const uint64_t bits = MixSeed(seed, counter++);
      const uint64_t pairs = (bits & 0x00ff00ff00ff00ffull) + ((bits >> 8) & 0x00ff00ff00ff00ffull);
      const uint64_t sum = (pairs * 0x0001000100010001ull) >> 48;
      row[x] += static_cast<float>(sum) * scale + offset;
    }
  }
}

Camera MakePinhole(const SimulateOptions& options) {
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = options.image_width_px;
  camera.height = options.image_height_px;
  // Rounded so that cameras.txt needs few digits: 90 degrees give 320, not 320.00000000000006.
  const double exact = 0.5 * camera.width / std::tan(0.5 * RadFromDeg(options.horizontal_fov_deg));
  const double focal = std::round(exact * 1e6) / 1e6;
  camera.params = {focal, focal, 0.5 * camera.width, 0.5 * camera.height};
  return camera;
}

Camera MakeFisheye(const SimulateOptions& options) {
  // Of a usual lens, and monotone beyond 100 degrees off the axis.
  constexpr double kK1 = -0.03, kK2 = 0.004;
  Camera camera;
  camera.model = CameraModel::kOpenCvFisheye;
  camera.width = options.image_width_px;
  camera.height = options.image_height_px;
  const double half = 0.5 * RadFromDeg(options.horizontal_fov_deg);
  const double radius = half * (1 + kK1 * half * half + kK2 * half * half * half * half);
  const double focal = std::round(0.5 * camera.width / radius * 1e6) / 1e6;
  camera.params = {focal, focal, 0.5 * camera.width, 0.5 * camera.height, kK1, kK2, 0, 0};
  return camera;
}

// Images along a way are read in this part of the time from one to the next, while the camera moves as fast
// as from the one before to the one after.
void ReadByRows(double readout_ratio, std::vector<PlannedImage>* images) {
  for (size_t i = 0; i < images->size(); ++i) {
    const size_t before = i == 0 ? 0 : i - 1, after = std::min(i + 1, images->size() - 1);
    const Pose motion = (*images)[after].cam_from_world * (*images)[before].cam_from_world.Inverse();
    const double part = readout_ratio / static_cast<double>(std::max<size_t>(1, after - before));
    const Eigen::AngleAxisd turn(motion.rotation);
    (*images)[i].readout_turn = part * turn.angle() * turn.axis();
    (*images)[i].readout_way = part * motion.translation;
  }
}

// The first is the rig's origin.
std::vector<Pose> CamerasOnRig(const SimulateOptions& options) {
  std::vector<Pose> cams_from_rig;
  Pose first_from_axis;
  for (int i = 0; i < options.rig_num_cameras; ++i) {
    Pose cam_from_axis;
    cam_from_axis.rotation =
        Eigen::AngleAxisd(2 * std::numbers::pi * i / options.rig_num_cameras, Eigen::Vector3d::UnitY());
    cam_from_axis.translation = {0, 0, -options.rig_radius_m};
    if (i == 0) first_from_axis = cam_from_axis;
    cams_from_rig.push_back(cam_from_axis * first_from_axis.Inverse());
  }
  return cams_from_rig;
}

// Each image, as the first camera's, becomes those of all cameras, one camera after the other.
std::vector<PlannedImage> TakenByRig(const std::vector<PlannedImage>& images,
                                     const std::vector<Pose>& cams_from_rig) {
  std::vector<PlannedImage> taken;
  for (size_t camera = 0; camera < cams_from_rig.size(); ++camera) {
    const Pose& cam_from_rig = cams_from_rig[camera];
    for (PlannedImage image : images) {
      image.name = RigFolder(static_cast<int>(camera)) + image.name;
      image.cam_from_world = cam_from_rig * image.cam_from_world;
      image.stated_cam_from_world = cam_from_rig * image.stated_cam_from_world;
      image.turn = cam_from_rig.rotation * image.turn;
      image.way = cam_from_rig.rotation * image.way;
      image.readout_turn = cam_from_rig.rotation * image.readout_turn;
      image.readout_way =
          cam_from_rig.rotation * image.readout_way - image.readout_turn.cross(cam_from_rig.translation);
      taken.push_back(std::move(image));
    }
  }
  return taken;
}

}  // namespace

Pose MakePose(const Eigen::Vector3d& centre, double heading_rad, double pitch_rad, double roll_rad) {
  const double c = std::cos(heading_rad), s = std::sin(heading_rad);
  Eigen::Matrix3d level;  // rows: right, down, forward
  level << s, -c, 0, 0, 0, -1, c, s, 0;
  const Eigen::Quaterniond tilt = Eigen::AngleAxisd(-roll_rad, Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(-pitch_rad, Eigen::Vector3d::UnitX());
  Pose pose;
  pose.rotation = (tilt * Eigen::Quaterniond(level)).normalized();
  pose.translation = -(pose.rotation * centre);
  return pose;
}

Camera MakeCamera(const SimulateOptions& options) {
  if (options.camera_model == "OPENCV_FISHEYE") return MakeFisheye(options);
  if (options.camera_model == "PINHOLE") return MakePinhole(options);
  Camera camera;
  camera.model = CameraModel::kEquirectangular;
  camera.width = options.panorama_width_px;
  camera.height = options.panorama_width_px / 2;
  return camera;
}

Camera MakeQueryCamera(const SimulateOptions& options) {
  if (options.camera_model != "EQUIRECTANGULAR") return MakeCamera(options);
  Camera camera = MakePinhole(options);
  camera.camera_id = 2;
  return camera;
}

std::string RigFolder(int camera) { return fmt::format("cam{}/", camera); }

Result<Survey> PlanSurvey(const Building& building, const SimulateOptions& options, uint64_t seed) {
  CAIRN_RETURN_IF_ERROR(CheckSimulateOptions(options));
  const double least_extent = std::min(options.width_m, options.depth_m);
  if (options.survey == "lattice" && options.spacing_m > least_extent) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "option spacing_m = {:g}: is larger than the building ({:g} x {:g} m); use a smaller spacing",
        options.spacing_m, options.width_m, options.depth_m);
  }
  Survey survey;
  survey.camera = MakeCamera(options);
  survey.query_camera = MakeQueryCamera(options);
  std::vector<double> headings;  // of a driven survey's stations
  CAIRN_RETURN_IF_ERROR(AddSurveyImages(building, options, seed, &headings, &survey));
  if (options.readout_ratio > 0) ReadByRows(options.readout_ratio, &survey.images);
  CAIRN_RETURN_IF_ERROR(AddQueries(building, options, seed, headings, &survey));
  survey.cams_from_rig = CamerasOnRig(options);
  if (options.rig_num_cameras > 1) {
    survey.queries = TakenByRig(survey.queries, survey.cams_from_rig);
    if (options.survey == "driven") survey.images = TakenByRig(survey.images, survey.cams_from_rig);
  }
  return survey;
}

cv::Mat TakeImage(const Renderer& renderer, const PlannedImage& image, uint64_t seed) {
  const double blur_px =
      (image.turn.norm() + image.way.norm() / kBlurDistanceM) * renderer.camera().MeanFocal();
  const int num_exposures = 1 + static_cast<int>(std::ceil(blur_px / kBlurStepPx));
  // `part`: of the motion, from the middle of the exposure.
  const auto render = [&](double part) {
    Pose moved = image.cam_from_world;
    moved.translation -= part * image.way;
    moved = RotatedInCamera(moved, part * image.turn);
    if (image.readout_turn.isZero(0) && image.readout_way.isZero(0)) return renderer.RenderFloat(moved);
    return renderer.RenderFloat([&](int row) {
      const double of_readout = (row + 0.5) / renderer.camera().height - 0.5;
      Pose at_row = RotatedInCamera(moved, of_readout * image.readout_turn);
      at_row.translation += of_readout * image.readout_way;
      return at_row;
    });
  };
  cv::Mat sum = render(0.5 / num_exposures - 0.5);
  for (int i = 1; i < num_exposures; ++i) sum += render((i + 0.5) / num_exposures - 0.5);
  sum.convertTo(sum, CV_32F, image.gain / num_exposures, image.bias);
  if (image.noise > 0) AddGreyNoise(sum, image.noise, seed);
  cv::Mat grey;
  sum.convertTo(grey, CV_8U);
  return grey;
}

}  // namespace cairn::sim
