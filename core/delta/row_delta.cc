#include "core/delta/row_delta.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "core/base/blob.h"
#include "core/blocks/map_layout.h"
#include "core/delta/prefix_compression.h"
#include "core/delta/renumbering.h"
#include "core/delta/row_text.h"
#include "core/packing/packed_landmarks.h"
#include "core/packing/packed_sights.h"

namespace cairn {
namespace {

// Lists are packed by those before them: so many at a time, as in blocks of images.
constexpr size_t kListsAtOnce = 64;

std::vector<int32_t> SymmetricDifference(const std::vector<int32_t>& a, const std::vector<int32_t>& b) {
  std::vector<int32_t> difference;
  std::set_symmetric_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(difference));
  return difference;
}

// The lists of a map that name its elements by number, ascending: what images see, what regions have.
// `List`: a std::vector<int32_t>, const or not.
template <class List>
struct Lists {
  std::vector<List*> lists;
  int64_t num_elements = 0;
  size_t max_length = 0;
};

template <class List, class Rows>
std::vector<Lists<List>> ListsOf(Rows* rows, int64_t num_landmarks) {
  const auto num_stations = static_cast<int64_t>(rows->stations.size());
  std::vector<Lists<List>> lists = {{{}, num_landmarks, kMaxImageLandmarks},
                                    {{}, num_landmarks, static_cast<size_t>(num_landmarks)},
                                    {{}, num_stations, static_cast<size_t>(num_stations)}};
  for (auto& image : rows->images) lists[0].lists.push_back(&image.landmarks);
  for (auto& region : rows->regions) {
    lists[1].lists.push_back(&region.landmarks);
    lists[2].lists.push_back(&region.stations);
  }
  return lists;
}

using GivenLists = Lists<const std::vector<int32_t>>;
using MadeLists = Lists<std::vector<int32_t>>;

void WriteDifferences(const GivenLists& from, const GivenLists& to, BlobWriter* writer) {
  for (size_t begin = 0; begin < to.lists.size(); begin += kListsAtOnce) {
    SightLists differences;
    for (size_t i = begin; i < std::min(begin + kListsAtOnce, to.lists.size()); ++i)
      differences.push_back(SymmetricDifference(*from.lists[i], *to.lists[i]));
    const std::string packed = PackSights(differences);
    writer->Varint(packed.size());
    writer->Bytes(packed);
  }
}

// Makes the lists of the first map those of the other.  `num_left`: of the elements that lists may have.
bool ReadDifferences(const MadeLists& lists, BlobReader* reader, int64_t* num_left) {
  for (size_t begin = 0; begin < lists.lists.size(); begin += kListsAtOnce) {
    SightLists differences(std::min(kListsAtOnce, lists.lists.size() - begin));
    const std::string_view packed = reader->Bytes(reader->Varint());
    // A list may lose as many as it has and get as many as it may have.
    if (!reader->ok() ||
        !UnpackSights(packed, lists.num_elements, 2 * lists.max_length, num_left, &differences)) {
      return false;
    }
    for (size_t i = 0; i < differences.size(); ++i) {
      std::vector<int32_t>& list = *lists.lists[begin + i];
      list = SymmetricDifference(list, differences[i]);
      *num_left -= std::ssize(list);
      if (list.size() > lists.max_length || *num_left < 0) return false;
    }
  }
  return true;
}

PackedLandmarks NewLandmarks(const MapRows& to, const Renumbering& same) {
  PackedLandmarks packed{.landmarks = {}, .descriptors = {}, .code = *to.descriptor_code};
  std::vector<Eigen::Index> rows;
  for (size_t i = 0; i < to.landmarks.size(); ++i) {
    if (same.landmarks[i] != Renumbering::kNew) continue;
    packed.landmarks.push_back(to.landmarks[i]);
    rows.push_back(static_cast<Eigen::Index>(i));
  }
  packed.descriptors = to.descriptors(rows, Eigen::all);
  return packed;
}

// What both sides know of landmarks in this code.
PackedLandmarks Known(const MapRows& from, const TransformCode& code) {
  PackedLandmarks known{.landmarks = {}, .descriptors = {}, .code = code};
  if (from.descriptor_code != code) return known;
  const auto num = static_cast<std::ptrdiff_t>(std::min(from.landmarks.size(), kMaxNumKnownLandmarks));
  known.landmarks.assign(from.landmarks.begin(), from.landmarks.begin() + num);
  known.descriptors = from.descriptors.topRows(num);
  return known;
}

void WriteCode(const TransformCode& code, const TransformCode& of_first, BlobWriter* writer) {
  writer->UInt8(code == of_first ? 0 : 1);
  if (code == of_first) return;
  writer->UInt8(static_cast<uint8_t>(code.step));
  writer->Bytes(code.mean.data(), code.mean.size());
}

bool ReadLandmarks(const MapRows& from, const Renumbering& renumbering, BlobReader* reader, MapRows* rows) {
  if (!from.descriptor_kind.is_sift()) return false;
  TransformCode code = from.descriptor_code.value_or(TransformCode());
  const uint8_t is_own_code = reader->UInt8();
  if (is_own_code > 1 || (is_own_code == 0 && !from.descriptor_code)) return false;
  if (is_own_code == 1) {
    code.step = reader->UInt8();
    const std::string_view mean = reader->Bytes(code.mean.size());
    std::copy(mean.begin(), mean.end(), code.mean.begin());
  }
  const std::string_view bytes = reader->Bytes(reader->Varint());
  const auto num_new = static_cast<size_t>(
      std::count(renumbering.landmarks.begin(), renumbering.landmarks.end(), Renumbering::kNew));
  PackedLandmarks packed;
  if (!reader->ok() || code.step < 1 || !UnpackMoreLandmarks(Known(from, code), bytes, num_new, &packed))
    return false;
  rows->descriptor_code = code;
  const auto num = static_cast<Eigen::Index>(renumbering.landmarks.size());
  rows->descriptors.resize(num, from.descriptors.cols());
  Eigen::Index next_new = 0;
  for (Eigen::Index i = 0; i < num; ++i) {
    const int32_t origin = renumbering.landmarks[i];
    const bool is_new = origin == Renumbering::kNew;
    rows->landmarks.push_back(is_new ? packed.landmarks[next_new] : from.landmarks[origin]);
    if (is_new) {
      rows->descriptors.row(i) = packed.descriptors.row(next_new++);
    } else {
      rows->descriptors.row(i) = from.descriptors.row(origin);
    }
  }
  return true;
}

}  // namespace

Result<std::optional<std::string>> MakeRowDelta(const MapRows& from, const MapRows& to,
                                                const std::string& what) {
  if (!from.descriptor_code || !to.descriptor_code || !from.descriptor_kind.is_sift())
    return std::optional<std::string>();
  const Renumbering same = FindSame(from, to);
  MapRows old = Renumbered(from, same);
  old.regions.resize(to.regions.size());
  BlobWriter writer;
  WriteRenumbering(same, &writer);
  writer.Varint(to.regions.size());
  WriteCode(*to.descriptor_code, *from.descriptor_code, &writer);
  const std::string packed = PackMoreLandmarks(Known(from, *to.descriptor_code), NewLandmarks(to, same));
  writer.Varint(packed.size());
  writer.Bytes(packed);
  const auto num_landmarks = static_cast<int64_t>(to.landmarks.size());
  const auto old_lists = ListsOf<const std::vector<int32_t>>(&std::as_const(old), num_landmarks);
  const auto lists = ListsOf<const std::vector<int32_t>>(&to, num_landmarks);
  for (size_t i = 0; i < lists.size(); ++i) WriteDifferences(old_lists[i], lists[i], &writer);
  const std::string text = WriteRowText(to);
  CAIRN_ASSIGN_OR_RETURN(const std::string frame, CompressAfter(WriteRowText(old), text, what));
  writer.Varint(text.size());
  writer.Bytes(frame);
  return std::optional(writer.Take());
}

Result<MapRows> ApplyRowDelta(const MapRows& from, std::string_view delta, int64_t max_num_bytes,
                              const std::string& what) {
  const auto corrupt = [&](const char* part) { return Corrupt(what, "its {} make no sense", part); };
  BlobReader reader(delta);
  const Renumbering renumbering =
      ReadRenumbering(from, max_num_bytes / static_cast<int64_t>(sizeof(MapLandmark)), &reader);
  if (!reader.ok()) return corrupt("numbers of elements");
  MapRows rows = Renumbered(from, renumbering);
  const uint64_t num_regions = reader.Varint();
  if (num_regions > static_cast<uint64_t>(max_num_bytes) / sizeof(MapRegion)) return corrupt("regions");
  rows.regions.resize(num_regions);
  if (!ReadLandmarks(from, renumbering, &reader, &rows)) return corrupt("landmarks");
  int64_t num_left = max_num_bytes / static_cast<int64_t>(sizeof(int32_t));
  for (const MadeLists& lists :
       ListsOf<std::vector<int32_t>>(&rows, static_cast<int64_t>(rows.landmarks.size()))) {
    if (!ReadDifferences(lists, &reader, &num_left)) return corrupt("lists");
  }
  const uint64_t num_text_bytes = reader.Varint();
  if (!reader.ok() || num_text_bytes > static_cast<uint64_t>(max_num_bytes)) return corrupt("texts");
  const std::string old_text = WriteRowText(rows);
  CAIRN_ASSIGN_OR_RETURN(const std::string text,
                         DecompressAfter(old_text, reader.Bytes(reader.num_left()), num_text_bytes, what));
  CAIRN_RETURN_IF_ERROR(ReadRowText(text, what, &rows));
  return rows;
}

std::string EncodedBlocks(const MapRows& rows) {
  const MapLayout layout(rows);
  std::string bytes;
  for (const BlockEntry& entry : layout.entries()) bytes += layout.Encode(entry);
  return bytes;
}

}  // namespace cairn
