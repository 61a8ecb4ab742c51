#include "stages/reconstruct/inertial/imu_file.h"

#include <array>
#include <cmath>
#include <string_view>

#include "core/base/quantiles.h"
#include "core/base/text.h"
#include "core/files/file.h"

namespace cairn::reconstruct {
namespace {

constexpr std::string_view kPlaceWord = "#imu_on_camera";
constexpr size_t kNumFields = 7;
constexpr double kMaxNormError = 0.01;  // of a quaternion
// Consumer parts give 50 to 4000 samples a second; fewer cannot follow a hand or a step.
constexpr double kMinRateHz = 50, kMaxRateHz = 10'000;
constexpr double kMinDurationS = 1;
// Gyros measure up to 2000 degrees a second.
constexpr double kMaxTurnRadPerS = 35;
// The median acceleration of anything that people or robots carry is within a quarter of gravity's.
constexpr double kMinGravity = 7.3, kMaxGravity = 12.3;
constexpr double kGravityInG[] = {0.75, 1.25}, kNoGravity = 3, kGravityInMilliG[] = {750, 1250};

Result<Pose> ParsePlace(std::string_view line) {
  std::optional<std::vector<double>> v;
  if (line.substr(kPlaceWord.size()).starts_with(',')) v = ParseNumbers(line.substr(kPlaceWord.size() + 1));
  if (!v || v->size() != kNumFields)
    return MakeError(ErrorCode::kCorrupt, "expected {},X,Y,Z,QX,QY,QZ,QW", kPlaceWord);
  const Eigen::Quaterniond rotation((*v)[6], (*v)[3], (*v)[4], (*v)[5]);
  if (!(std::abs(rotation.norm() - 1) <= kMaxNormError))
    return MakeError(ErrorCode::kCorrupt, "a quaternion of length {:.3g}, not 1", rotation.norm());
  return Pose{rotation.normalized(), {(*v)[0], (*v)[1], (*v)[2]}};
}

Result<ImuSample> ParseSample(const std::vector<std::string>& fields) {
  ImuSample sample;
  std::array<double, 6> v{};
  bool is_valid = fields.size() == kNumFields && ParseNumber(fields[0], &sample.time_ns);
  for (size_t i = 0; is_valid && i < v.size(); ++i)
    is_valid = ParseNumber(fields[i + 1], &v[i]) && std::isfinite(v[i]);
  if (!is_valid) {
    return MakeError(
        ErrorCode::kCorrupt,
        "expected TIME_NS,WX,WY,WZ,AX,AY,AZ: an integer, nanoseconds, and six finite numbers, rad/s "
        "and m/s^2");
  }
  sample.gyro = {v[0], v[1], v[2]};
  sample.accel = {v[3], v[4], v[5]};
  return sample;
}

// A first line of words names the columns.
bool IsHeader(std::string_view line) {
  return line.find_first_of("0123456789") != 0 && line.front() != '-' && line.front() != '+';
}

Status ReadLine(std::string_view line, bool may_be_header, ImuRecording* imu) {
  if (line.starts_with(kPlaceWord)) {
    if (imu->cam_from_imu) return MakeError(ErrorCode::kCorrupt, "{} stands there twice", kPlaceWord);
    CAIRN_ASSIGN_OR_RETURN(imu->cam_from_imu, ParsePlace(line));
    return Ok();
  }
  if (line.empty() || line.front() == '#' || (may_be_header && IsHeader(line))) return Ok();
  CAIRN_ASSIGN_OR_RETURN(const ImuSample sample, ParseSample(SplitFields(line, ',')));
  if (!imu->samples.empty() && sample.time_ns <= imu->samples.back().time_ns) {
    return MakeError(ErrorCode::kCorrupt,
                     "the time {} is not after {}, the one before: sort the lines by time", sample.time_ns,
                     imu->samples.back().time_ns);
  }
  imu->samples.push_back(sample);
  return Ok();
}

Status CheckRate(const std::string& path, ImuRecording* imu) {
  const auto seconds = [&](size_t i, size_t j) {
    return 1e-9 * static_cast<double>(imu->samples[j].time_ns - imu->samples[i].time_ns);
  };
  const size_t num = imu->samples.size();
  if (num < 2) return MakeError(ErrorCode::kNoData, "{}: {} samples say nothing of a motion", path, num);
  std::vector<double> steps;
  for (size_t i = 1; i < num; ++i) steps.push_back(seconds(i - 1, i));
  imu->typical_step_s = Median(steps);
  const double rate_hz = 1 / imu->typical_step_s;
  if (rate_hz < kMinRateHz || rate_hz > kMaxRateHz) {
    return MakeError(ErrorCode::kNoData,
                     "{}: {:.4g} samples a second; {:g} to {:g} are of use.  Times are nanoseconds", path,
                     rate_hz, kMinRateHz, kMaxRateHz);
  }
  if (seconds(0, num - 1) < kMinDurationS) {
    return MakeError(ErrorCode::kNoData, "{}: {:.3f} s are too short to say anything", path,
                     seconds(0, num - 1));
  }
  return Ok();
}

Status CheckUnits(const std::string& path, const ImuRecording& imu) {
  std::vector<double> turns, accelerations;
  for (const ImuSample& sample : imu.samples) {
    turns.push_back(sample.gyro.norm());
    accelerations.push_back(sample.accel.norm());
  }
  const double turn = Quantile(turns, 0.95), acceleration = Median(accelerations);
  if (turn > kMaxTurnRadPerS) {
    return MakeError(
        ErrorCode::kNoData,
        "{}: it turns by {:.0f} rad/s, which no gyro measures: in degrees a second? Columns 2 to 4 "
        "are rad/s",
        path, turn);
  }
  if (acceleration >= kMinGravity && acceleration <= kMaxGravity) return Ok();
  const char* guess = "";
  if (acceleration >= kGravityInG[0] && acceleration <= kGravityInG[1]) guess = ": in g?";
  if (acceleration >= kGravityInMilliG[0] && acceleration <= kGravityInMilliG[1]) guess = ": in mg?";
  if (acceleration < kGravityInG[0] || (acceleration > kGravityInG[1] && acceleration < kNoGravity))
    guess = ": with gravity taken out? What the accelerometer measures is wanted, gravity and all.";
  return MakeError(
      ErrorCode::kNoData,
      "{}: the accelerations are {:.3g} m/s^2 on the median, not gravity's 9.81{} Columns 5 to 7 are "
      "m/s^2",
      path, acceleration, *guess != '\0' ? guess : ".");
}

}  // namespace

Result<ImuRecording> ReadImu(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  ImuRecording imu;
  int line_number = 0;
  bool may_be_header = true;
  for (const std::string_view whole : SplitLines(text)) {
    ++line_number;
    const std::string_view line = Trim(whole);
    if (const Status status = ReadLine(line, may_be_header, &imu); !status.ok())
      return MakeError(ErrorCode::kCorrupt, "{}:{}: {}", path, line_number, status.error().message);
    may_be_header &= line.empty() || line.front() == '#';
  }
  CAIRN_RETURN_IF_ERROR(CheckRate(path, &imu));
  CAIRN_RETURN_IF_ERROR(CheckUnits(path, imu));
  return imu;
}

}  // namespace cairn::reconstruct
