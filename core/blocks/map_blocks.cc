// Blocks of images, stations, regions and words as bytes: drawn in schemas/FORMAT.md.
#include "core/blocks/map_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/blob.h"
#include "core/packing/map_codes.h"
#include "core/packing/packed_sights.h"

namespace cairn {
namespace {

constexpr double kMaxCoordinate = 2e9;  // 200 km in units of 0.1 mm
constexpr double kHeadingUnitDeg = 1e-3;
constexpr int64_t kMaxHeading = 1'000'000'000;  // a million degrees

template <typename T>
int64_t ListBytes(const std::vector<std::vector<T>>& lists) {
  int64_t num_bytes = 0;
  for (const std::vector<T>& list : lists) {
    num_bytes += static_cast<int64_t>(sizeof(list) + list.size() * sizeof(T));
  }
  return num_bytes;
}

}  // namespace

std::string EncodeBlock(const ImageBlock& block) {
  BlobWriter writer;
  int64_t image_id = -1;
  std::string_view name;
  for (const MapImage& image : block.images) {
    writer.Varint(static_cast<uint64_t>(image.image_id - image_id));
    image_id = image.image_id;
    // A name often begins like the one before.
    const std::string_view next(image.name);
    const size_t shared =
        std::mismatch(name.begin(), name.end(), next.begin(), next.end()).first - name.begin();
    writer.Varint(shared);
    writer.Varint(next.size() - shared);
    writer.Bytes(next.substr(shared));
    name = next;
    writer.Varint(image.camera_id);
    writer.Varint(static_cast<uint64_t>(image.station + 1));
    WriteRotation(image.cam_from_world.rotation, &writer);
    for (const double t : image.cam_from_world.translation) {
      writer.UInt32(static_cast<uint32_t>(EncodeLength(t)));
    }
    if (!block.is_packed) WriteRuns(image.landmarks, &writer);
  }
  if (block.is_packed) {
    SightLists lists;
    for (const MapImage& image : block.images) lists.push_back(image.landmarks);
    writer.Bytes(PackSights(lists));
  }
  return writer.Take();
}

Result<ImageBlock> DecodeImageBlock(std::string_view bytes, const BlockEntry& entry,
                                    const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  ImageBlock block;
  block.first = static_cast<int32_t>(entry.first);
  int64_t image_id = -1;
  int64_t max_num_landmarks = 16 * int64_t{kMaxImageLandmarks};
  for (uint32_t i = 0; i < entry.count; ++i) {
    const auto corrupt = [&](const char* part) {
      return Corrupt(what, "{} of image {} of {} make no sense", part, i, entry.count);
    };
    MapImage& image = block.images.emplace_back();
    const uint64_t step = reader.Varint();
    if (step == 0 || step > kInvalidImageId) return corrupt("the id and what follows");
    image_id += static_cast<int64_t>(step);
    if (image_id >= kInvalidImageId) return corrupt("the id and what follows");
    image.image_id = static_cast<ImageId>(image_id);
    const uint64_t shared = reader.Varint();
    const uint64_t rest = reader.Varint();
    const std::string_view suffix = reader.Bytes(rest);
    const std::string_view previous = i == 0 ? "" : std::string_view(block.images[i - 1].name);
    if (!reader.ok() || shared > previous.size() || shared + rest > kMaxNameBytes)
      return corrupt("the name and what follows");
    image.name = std::string(previous.substr(0, shared)) + std::string(suffix);
    const uint64_t camera_id = reader.Varint();
    const uint64_t station = reader.Varint();
    if (camera_id > std::numeric_limits<CameraId>::max() ||
        station > static_cast<uint64_t>(directory.Count(BlockKind::kStations))) {
      return corrupt("the camera and the station");
    }
    image.camera_id = static_cast<CameraId>(camera_id);
    image.station = static_cast<StationIdx>(station) - 1;
    image.cam_from_world.rotation = ReadRotation(&reader);
    for (double& t : image.cam_from_world.translation) {
      const auto code = static_cast<int32_t>(reader.UInt32());
      if (std::abs(static_cast<double>(code)) > kMaxCoordinate) return corrupt("the coordinates");
      t = DecodeLength(code);
    }
    if (entry.is_packed) continue;
    int64_t max_num_values = std::min<int64_t>(kMaxImageLandmarks, max_num_landmarks);
    const int64_t before = max_num_values;
    if (!ReadRuns(&reader, directory.Count(BlockKind::kLandmarks), &max_num_values, &image.landmarks)) {
      return corrupt("the pose and the landmarks");
    }
    max_num_landmarks -= before - max_num_values;
  }
  if (entry.is_packed) {
    block.is_packed = true;
    SightLists lists(block.images.size());
    if (!reader.ok() || !UnpackSights(reader.Bytes(reader.num_left()), directory.Count(BlockKind::kLandmarks),
                                      kMaxImageLandmarks, &max_num_landmarks, &lists)) {
      return Corrupt(what, "the packed landmarks of {} images make no sense", entry.count);
    }
    for (size_t i = 0; i < lists.size(); ++i) block.images[i].landmarks = std::move(lists[i]);
    return block;
  }
  if (!reader.Finished()) return Corrupt(what, "bytes are left after {} images", entry.count);
  return block;
}

std::string EncodeBlock(const StationBlock& block) {
  BlobWriter writer;
  for (size_t i = 0; i < block.stations.size(); ++i) {
    const MapStation& station = block.stations[i];
    writer.Varint(ZigZag(EncodeLength(station.position.x())));
    writer.Varint(ZigZag(EncodeLength(station.position.y())));
    writer.UInt8((station.is_covered ? 1 : 0) | (station.heading_deg ? 2 : 0));
    if (station.heading_deg) writer.Varint(ZigZag(std::llround(*station.heading_deg / kHeadingUnitDeg)));
    WriteRuns(block.neighbours[i], &writer);
    WriteRuns(block.regions[i], &writer);
  }
  return writer.Take();
}

Result<StationBlock> DecodeStationBlock(std::string_view bytes, const BlockEntry& entry,
                                        const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  StationBlock block;
  block.first = static_cast<StationIdx>(entry.first);
  int64_t max_num_values = kMaxListElements;
  for (uint32_t i = 0; i < entry.count; ++i) {
    MapStation& station = block.stations.emplace_back();
    for (double& coordinate : station.position) {
      const int64_t code = UnZigZag(reader.Varint());
      if (std::abs(static_cast<double>(code)) > kMaxCoordinate) {
        return Corrupt(what, "station {} lies more than 200 km from the origin", entry.first + i);
      }
      coordinate = DecodeLength(code);
    }
    const uint8_t flags = reader.UInt8();
    station.is_covered = (flags & 1) != 0;
    if ((flags & 2) != 0) {
      const int64_t heading = UnZigZag(reader.Varint());
      if (std::abs(static_cast<double>(heading)) > kMaxHeading) {
        return Corrupt(what, "station {}: its heading is not valid", entry.first + i);
      }
      station.heading_deg = static_cast<double>(heading) * kHeadingUnitDeg;
    }
    if (flags > 3 ||
        !ReadRuns(&reader, directory.Count(BlockKind::kStations), &max_num_values,
                  &block.neighbours.emplace_back()) ||
        !ReadRuns(&reader, directory.Count(BlockKind::kRegions), &max_num_values,
                  &block.regions.emplace_back())) {
      return Corrupt(what, "the neighbours or regions of station {} make no sense", entry.first + i);
    }
    if (!block.neighbours.back().empty() &&
        block.neighbours.back().front() <= static_cast<int64_t>(entry.first) + i) {
      return Corrupt(what, "station {} has a neighbour that is not larger", entry.first + i);
    }
  }
  if (!reader.Finished()) return Corrupt(what, "bytes are left after {} stations", entry.count);
  return block;
}

std::string EncodeBlock(const RegionBlock& block) {
  BlobWriter writer;
  for (const std::vector<int32_t>& landmark_blocks : block.landmark_blocks)
    WriteRuns(landmark_blocks, &writer);
  return writer.Take();
}

Result<RegionBlock> DecodeRegionBlock(std::string_view bytes, const BlockEntry& entry,
                                      const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  RegionBlock block;
  block.first = static_cast<RegionIdx>(entry.first);
  int64_t max_num_values = kMaxListElements;
  for (uint32_t i = 0; i < entry.count; ++i) {
    if (!ReadRuns(&reader, directory.NumBlocks(BlockKind::kLandmarks), &max_num_values,
                  &block.landmark_blocks.emplace_back())) {
      return Corrupt(what, "the landmark blocks of region {} make no sense", entry.first + i);
    }
  }
  if (!reader.Finished()) return Corrupt(what, "bytes are left after {} regions", entry.count);
  return block;
}

std::vector<Posting> WordBlock::Postings(size_t i) const {
  std::vector<Posting> postings;
  postings.reserve(NumPostings(i));
  ForPostings(i, [&](const Posting& posting) { postings.push_back(posting); });
  return postings;
}

WordBlock PackWords(WordIdx first, const std::vector<std::vector<Posting>>& postings) {
  WordBlock block{.first = first, .bytes = {}, .begins = {}};
  BlobWriter writer;
  for (const std::vector<Posting>& of_word : postings) {
    block.begins.push_back(static_cast<uint32_t>(writer.num_bytes()));
    writer.Varint(of_word.size());
    int64_t document = -1;
    for (const Posting& posting : of_word) {
      // Most words occur once in a document.
      writer.Varint(2 * static_cast<uint64_t>(posting.document - document - 1) + (posting.count > 1 ? 1 : 0));
      if (posting.count > 1) writer.Varint(static_cast<uint64_t>(posting.count - 2));
      document = posting.document;
    }
  }
  block.bytes = writer.Take();
  return block;
}

std::string EncodeBlock(const WordBlock& block) { return block.bytes; }

Result<WordBlock> DecodeWordBlock(std::string_view bytes, const BlockEntry& entry,
                                  const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  WordBlock block{.first = static_cast<WordIdx>(entry.first), .bytes = {}, .begins = {}};
  const auto num_images = static_cast<uint64_t>(directory.Count(BlockKind::kImages));
  for (uint32_t i = 0; i < entry.count; ++i) {
    const auto corrupt = [&] {
      return MakeError(ErrorCode::kCorrupt, "{}: word {}: its postings are not ascending images below {}",
                       what, entry.first + i, num_images);
    };
    block.begins.push_back(static_cast<uint32_t>(bytes.size() - reader.num_left()));
    const uint64_t num_postings = reader.Varint();
    if (num_postings > reader.num_left()) return corrupt();
    int64_t document = -1;
    for (uint64_t k = 0; k < num_postings; ++k) {
      const uint64_t head = reader.Varint();
      const uint64_t more = head % 2 == 1 ? reader.Varint() : 0;
      if (head / 2 >= num_images || more > std::numeric_limits<int32_t>::max() - 2) return corrupt();
      document += static_cast<int64_t>(head / 2) + 1;
      if (document >= static_cast<int64_t>(num_images)) return corrupt();
    }
  }
  if (!reader.Finished()) return Corrupt(what, "bytes are left after {} words", entry.count);
  block.bytes = bytes;
  return block;
}

std::string EncodeVocabularyTree(const Vocabulary& vocabulary) {
  BlobWriter writer;
  writer.Varint(static_cast<uint64_t>(vocabulary.branching));
  writer.Varint(static_cast<uint64_t>(vocabulary.depth));
  for (const VocabularyNode& node : vocabulary.nodes) writer.Varint(static_cast<uint64_t>(node.num_children));
  if (vocabulary.nodes.size() > 1) {
    writer.Bytes(vocabulary.centres.row(1).data(), (vocabulary.nodes.size() - 1) * vocabulary.centres.cols());
  }
  return writer.Take();
}

Result<Vocabulary> DecodeVocabularyTree(std::string_view bytes, const BlockEntry& entry,
                                        const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  Vocabulary vocabulary;
  vocabulary.kind = directory.descriptor_kind();
  const uint64_t branching = reader.Varint();
  const uint64_t depth = reader.Varint();
  if (branching > 1000 || depth > 1000)
    return Corrupt(what, "a tree of {} levels, {} branches", depth, branching);
  vocabulary.branching = static_cast<int>(branching);
  vocabulary.depth = static_cast<int>(depth);
  vocabulary.nodes.resize(entry.count);
  for (VocabularyNode& node : vocabulary.nodes) {
    const uint64_t num_children = reader.Varint();
    if (num_children >= entry.count && num_children > 0) {
      return Corrupt(what, "a vocabulary node with {} children of {}", num_children, entry.count);
    }
    node.num_children = static_cast<int32_t>(num_children);
  }
  const std::string_view centres = reader.Bytes((size_t{entry.count} - 1) * vocabulary.kind.num_values);
  if (!reader.Finished()) return Corrupt(what, "{} bytes do not fit {} nodes", bytes.size(), entry.count);
  if (Status status = NumberVocabularyNodes(&vocabulary); !status.ok()) {
    return Corrupt(what, "{}", status.error().message);
  }
  if (vocabulary.num_words() != directory.Count(BlockKind::kWords)) {
    return Corrupt(what, "{} leaves, but {} words", vocabulary.num_words(),
                   directory.Count(BlockKind::kWords));
  }
  vocabulary.centres = DescriptorMatrix::Zero(entry.count, vocabulary.kind.num_values);
  if (!centres.empty()) std::memcpy(vocabulary.centres.row(1).data(), centres.data(), centres.size());
  return vocabulary;
}

std::string EncodeDocumentNorms(const std::vector<float>& norms) {
  BlobWriter writer;
  for (const float norm : norms) writer.Float32(norm);
  return writer.Take();
}

Result<std::vector<float>> DecodeDocumentNorms(std::string_view bytes, const BlockEntry& entry,
                                               const std::string& what) {
  BlobReader reader(bytes);
  std::vector<float> norms(entry.count);
  for (float& norm : norms) {
    norm = reader.Float32();
    if (!(norm >= 0) || !std::isfinite(norm)) return Corrupt(what, "a norm is not a valid number");
  }
  if (!reader.Finished()) return Corrupt(what, "{} bytes are not {} numbers", bytes.size(), entry.count);
  return norms;
}

int64_t NumBytes(const ImageBlock& block) {
  int64_t num_bytes = sizeof(block);
  for (const MapImage& image : block.images) {
    num_bytes += static_cast<int64_t>(sizeof(image) + image.name.capacity() +
                                      image.landmarks.capacity() * sizeof(LandmarkIdx));
  }
  return num_bytes;
}

int64_t NumBytes(const StationBlock& block) {
  return static_cast<int64_t>(block.stations.size() * sizeof(MapStation)) + ListBytes(block.neighbours) +
         ListBytes(block.regions);
}

int64_t NumBytes(const RegionBlock& block) { return ListBytes(block.landmark_blocks); }

int64_t NumBytes(const WordBlock& block) {
  return static_cast<int64_t>(sizeof(block) + block.bytes.capacity() +
                              block.begins.capacity() * sizeof(uint32_t));
}

int64_t NumBytes(const Vocabulary& vocabulary) {
  return static_cast<int64_t>(vocabulary.nodes.size() * sizeof(VocabularyNode)) + vocabulary.centres.size() +
         ListBytes(vocabulary.inverted_files);
}

int64_t NumBytes(const std::vector<float>& values) {
  return static_cast<int64_t>(values.size() * sizeof(float));
}

}  // namespace cairn
