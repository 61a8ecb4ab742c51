// Blocks of the visual map as bytes: drawn in schemas/FORMAT.md.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/blob.h"
#include "core/blocks/map_blocks.h"
#include "core/packing/map_codes.h"
#include "core/world/visual_map.h"

namespace cairn {
namespace {

constexpr double kPixelUnit = 1.0 / 8;
constexpr double kLeastPixel = -2048;  // a turn moves sights out of their images
constexpr double kMostPixel = 6143;
constexpr double kOctaveUnit = 1.0 / 16;
constexpr double kLeastOctave = -4;
constexpr double kModelHeadingUnitDeg = 0.01;
constexpr int kMaxNumHeadings = 64;
constexpr uint8_t kBadFlag = 0x80;

uint16_t PixelCode(float px) {
  return static_cast<uint16_t>(std::clamp(std::lround((px - kLeastPixel) / kPixelUnit), 0L, 65535L));
}
float PixelOf(uint16_t code) { return static_cast<float>(kLeastPixel + code * kPixelUnit); }
uint8_t OctaveCode(float octave) {
  return static_cast<uint8_t>(std::clamp(std::lround((octave - kLeastOctave) / kOctaveUnit), 0L, 255L));
}
float OctaveOf(uint8_t code) { return static_cast<float>(kLeastOctave + code * kOctaveUnit); }
uint16_t HeadingCode(double heading_deg) {
  return static_cast<uint16_t>(std::lround(heading_deg / kModelHeadingUnitDeg));
}

Eigen::Vector3f RoundSeen(const Eigen::Vector3f& seen) {
  return {PixelOf(PixelCode(seen.x())), PixelOf(PixelCode(seen.y())), OctaveOf(OctaveCode(seen.z()))};
}

bool IsAscending(const std::vector<double>& values) {
  return std::adjacent_find(values.begin(), values.end(), std::greater_equal<>()) == values.end();
}

template <typename... Args>
Error InvalidVisual(fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument, "visual map: {}",
                   fmt::format(format, std::forward<Args>(args)...));
}

std::array<float, 4> ValuesOf(const VisualErrors& errors) {
  return {errors.shared_m, errors.shared_rad, errors.growth_per_m, errors.tilt_rad};
}

Status CheckModel(const HeadingModel& model, size_t landmark, int64_t num_images) {
  if (model.shape.length < 0 || model.shape.length >= kNumKernelLengths || model.shape.noise < 0 ||
      model.shape.noise >= kNumKernelNoises) {
    return InvalidVisual("landmark {}: there is no kernel {}, {}", landmark, model.shape.length,
                         model.shape.noise);
  }
  if (!model.sigma.allFinite() || (model.sigma.array() < 0).any())
    return InvalidVisual("landmark {}: its errors are not valid numbers", landmark);
  if (model.sights.size() < kMinNumSights || model.sights.size() > kMaxNumSights)
    return InvalidVisual("landmark {}: a model of {} sights, expected {} to {}", landmark,
                         model.sights.size(), kMinNumSights, kMaxNumSights);
  int64_t before = -1;
  for (const LandmarkSight& sight : model.sights) {
    if (sight.image <= before || sight.image >= num_images)
      return InvalidVisual("landmark {}: its images are not ascending below {}", landmark, num_images);
    if (!sight.seen.allFinite()) return InvalidVisual("landmark {}: a sight is not a valid number", landmark);
    before = sight.image;
  }
  return Ok();
}

void WriteModel(const HeadingModel& model, BlobWriter* writer) {
  writer->UInt8(static_cast<uint8_t>(model.shape.length * kNumKernelNoises + model.shape.noise) |
                (model.predicts_badly ? kBadFlag : 0));
  for (const double sigma : model.sigma) writer->UInt8(EncodeSize(sigma));
  std::vector<int32_t> images;
  for (const LandmarkSight& sight : model.sights) images.push_back(sight.image);
  WriteRuns(images, writer);
  for (const LandmarkSight& sight : model.sights) {
    for (const float px : {sight.seen.x(), sight.seen.y()}) {
      const uint16_t code = PixelCode(px);
      writer->UInt8(static_cast<uint8_t>(code & 0xff));
      writer->UInt8(static_cast<uint8_t>(code >> 8));
    }
    writer->UInt8(OctaveCode(sight.seen.z()));
  }
}

void ReadModel(BlobReader* reader, int64_t num_images, int64_t* max_num_values, HeadingModel* model) {
  const uint8_t shape = reader->UInt8();
  model->predicts_badly = (shape & kBadFlag) != 0;
  model->shape = {(shape & ~kBadFlag) / kNumKernelNoises, (shape & ~kBadFlag) % kNumKernelNoises};
  for (double& sigma : model->sigma) sigma = DecodeSize(reader->UInt8());
  std::vector<int32_t> images;
  if (!ReadRuns(reader, num_images, max_num_values, &images)) return reader->Fail();
  if (images.size() > kMaxNumSights || images.size() * 5 > reader->num_left()) return reader->Fail();
  for (const int32_t image : images) {
    LandmarkSight& sight = model->sights.emplace_back();
    sight.image = image;
    for (int axis = 0; axis < 2; ++axis) {
      const uint16_t low = reader->UInt8();
      sight.seen[axis] = PixelOf(static_cast<uint16_t>(low | (reader->UInt8() << 8)));
    }
    sight.seen.z() = OctaveOf(reader->UInt8());
  }
}

}  // namespace

Status RoundAsStored(VisualMapData* visual_map) {
  for (double& heading : visual_map->headings_deg)
    heading = (HeadingCode(heading) % 36000) * kModelHeadingUnitDeg;
  for (std::vector<HeadingModel>& models : visual_map->landmarks) {
    for (HeadingModel& model : models) {
      for (double& sigma : model.sigma) sigma = DecodeSize(EncodeSize(sigma));
      for (LandmarkSight& sight : model.sights) {
        const auto seen = sight.seen.head<2>().array();
        if (!(seen >= kLeastPixel && seen <= kMostPixel).all()) {
          return MakeError(ErrorCode::kUnsupported,
                           "visual map: a landmark is seen at {:g}, {:g} px; images of up to 6143 px a side "
                           "can be stored: set [emit_map] visual_map = false",
                           sight.seen.x(), sight.seen.y());
        }
        sight.seen = RoundSeen(sight.seen);
      }
    }
  }
  return Ok();
}

Status CheckVisualMap(const VisualMapData& visual_map, int64_t num_landmarks, int64_t num_images) {
  if (visual_map.landmarks.empty()) return Ok();
  if (static_cast<int64_t>(visual_map.landmarks.size()) != num_landmarks)
    return InvalidVisual("models of {} landmarks of {}", visual_map.landmarks.size(), num_landmarks);
  if (!(visual_map.focal_px >= 0 && visual_map.focal_px < 1e6F))
    return InvalidVisual("its focal length is not valid");
  for (const float value : ValuesOf(visual_map.errors)) {
    if (!(value >= 0 && value < 1e6F)) return InvalidVisual("its errors are not valid numbers");
  }
  const std::vector<double>& headings = visual_map.headings_deg;
  if (headings.empty() || headings.size() > kMaxNumHeadings || !(headings.front() >= 0) ||
      !(headings.back() < 360) || !IsAscending(headings)) {
    return InvalidVisual("its {} headings are not 1 to {} ascending ones", headings.size(), kMaxNumHeadings);
  }
  for (size_t landmark = 0; landmark < visual_map.landmarks.size(); ++landmark) {
    int64_t before = -1;
    for (const HeadingModel& model : visual_map.landmarks[landmark]) {
      if (model.heading <= before || model.heading >= static_cast<int64_t>(headings.size()))
        return InvalidVisual("landmark {}: its headings are not ascending below {}", landmark,
                             headings.size());
      before = model.heading;
      CAIRN_RETURN_IF_ERROR(CheckModel(model, landmark, num_images));
    }
  }
  return Ok();
}

std::string EncodeBlock(const VisualBlock& block) {
  BlobWriter writer;
  writer.Varint(block.part.camera_id);
  writer.Float32(block.part.focal_px);
  for (const float value : ValuesOf(block.part.errors)) writer.Float32(value);
  writer.UInt8(static_cast<uint8_t>(block.part.headings_deg.size()));
  for (const double heading : block.part.headings_deg) writer.Varint(HeadingCode(heading));
  for (const std::vector<HeadingModel>& models : block.part.landmarks) {
    std::vector<int32_t> headings;
    for (const HeadingModel& model : models) headings.push_back(model.heading);
    WriteRuns(headings, &writer);
    for (const HeadingModel& model : models) WriteModel(model, &writer);
  }
  return writer.Take();
}

Result<VisualBlock> DecodeVisualBlock(std::string_view bytes, const BlockEntry& entry,
                                      const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  VisualBlock block;
  block.first = static_cast<LandmarkIdx>(entry.first);
  const uint64_t camera_id = reader.Varint();
  block.part.camera_id = static_cast<CameraId>(camera_id);
  block.part.focal_px = reader.Float32();
  VisualErrors& errors = block.part.errors;
  for (float* value : {&errors.shared_m, &errors.shared_rad, &errors.growth_per_m, &errors.tilt_rad}) {
    *value = reader.Float32();
  }
  const int num_headings = reader.UInt8();
  for (int i = 0; i < num_headings && reader.ok(); ++i) {
    const uint64_t code = reader.Varint();
    if (code >= 36000) return Corrupt(what, "heading {} is {} hundredths of a degree", i, code);
    block.part.headings_deg.push_back(static_cast<double>(code) * kModelHeadingUnitDeg);
  }
  if (camera_id != block.part.camera_id) return Corrupt(what, "camera {} is not valid", camera_id);
  int64_t max_num_values = kMaxListElements;
  for (uint32_t i = 0; i < entry.count; ++i) {
    std::vector<int32_t> headings;
    std::vector<HeadingModel>& models = block.part.landmarks.emplace_back();
    bool is_read = ReadRuns(&reader, num_headings, &max_num_values, &headings);
    for (const int32_t heading : headings) {
      HeadingModel& model = models.emplace_back();
      model.heading = heading;
      ReadModel(&reader, directory.Count(BlockKind::kImages), &max_num_values, &model);
      is_read = is_read && reader.ok();
      if (!is_read) break;
    }
    if (!is_read) return Corrupt(what, "the models of landmark {} make no sense", int64_t{entry.first} + i);
  }
  if (!reader.Finished()) return Corrupt(what, "bytes are left after {} landmarks", entry.count);
  if (const Status status = CheckVisualMap(block.part, entry.count, directory.Count(BlockKind::kImages));
      !status.ok()) {
    return Corrupt(what, "{}", status.error().message);
  }
  return block;
}

Status CheckSameSurvey(const VisualBlock& block, const VisualMapData& other, const std::string& what) {
  if (other.camera_id == block.part.camera_id && other.focal_px == block.part.focal_px &&
      other.errors == block.part.errors && other.headings_deg == block.part.headings_deg)
    return Ok();
  return Corrupt(what, "its camera and headings are not those of the block before");
}

Status AppendModels(const VisualBlock& block, const std::string& what, VisualMapData* visual_map) {
  if (visual_map->landmarks.empty()) {
    visual_map->camera_id = block.part.camera_id;
    visual_map->focal_px = block.part.focal_px;
    visual_map->errors = block.part.errors;
    visual_map->headings_deg = block.part.headings_deg;
  } else {
    CAIRN_RETURN_IF_ERROR(CheckSameSurvey(block, *visual_map, what));
  }
  visual_map->landmarks.insert(visual_map->landmarks.end(), block.part.landmarks.begin(),
                               block.part.landmarks.end());
  return Ok();
}

int64_t NumBytes(const VisualBlock& block) {
  int64_t num_bytes = sizeof(block);
  for (const std::vector<HeadingModel>& models : block.part.landmarks) {
    for (const HeadingModel& model : models) {
      num_bytes += static_cast<int64_t>(sizeof(model) + model.sights.size() * sizeof(LandmarkSight));
    }
  }
  return num_bytes;
}

}  // namespace cairn
