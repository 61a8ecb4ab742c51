// Whole maps read: all blocks of a map file as rows.
#include "core/blocks/map_documents.h"
#include "core/blocks/map_rows.h"
#include "core/map/map_file.h"

namespace cairn {
namespace {

class RowsReader {
 public:
  RowsReader(const MapFile& file, MapRows* rows)
      : file_(file), rows_(*rows), num_bytes_left_(MaxRowBytes(file.num_bytes())) {}

  Status Read() {
    static_cast<MapHead&>(rows_) = file_.head();
    const MapDirectory& directory = file_.directory();
    rows_.regions.resize(directory.Count(BlockKind::kRegions));
    // Packed landmarks can take few bytes: what they decode to is limited before it is allocated.
    if (directory.Count(BlockKind::kLandmarks) * file_.head().descriptor_kind.num_values > num_bytes_left_)
      return TooMuch();
    rows_.descriptors.resize(directory.Count(BlockKind::kLandmarks), file_.head().descriptor_kind.num_values);
    rows_.landmarks.reserve(directory.Count(BlockKind::kLandmarks));
    for (int64_t block = 0; block < static_cast<int64_t>(directory.blocks().size()); ++block) {
      CAIRN_RETURN_IF_ERROR(ReadBlock(block, directory.blocks()[block]));
    }
    if (!rows_.vocabulary.nodes.empty()) CAIRN_RETURN_IF_ERROR(NameDocuments());
    WeightVocabulary(&rows_.vocabulary);
    CAIRN_ASSIGN_OR_RETURN(rows_.findings, file_.ReadFindings());
    return CheckMapRows(rows_);
  }

 private:
  Status ReadBlock(int64_t block, const BlockEntry& entry) {
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, file_.ReadBlock(block));
    const std::string what = file_.NameOf(block);
    const MapDirectory& directory = file_.directory();
    switch (static_cast<BlockKind>(entry.kind)) {
      case BlockKind::kStations:
        return Take(DecodeStationBlock(bytes, entry, directory, what),
                    [&](StationBlock block) { return AddStations(block); });
      case BlockKind::kRegions:  // follow from the landmark blocks
        return Take(DecodeRegionBlock(bytes, entry, directory, what),
                    [](const RegionBlock&) { return Ok(); });
      case BlockKind::kVocabularyTree:
        return Take(DecodeVocabularyTree(bytes, entry, directory, what), [&](Vocabulary tree) {
          rows_.vocabulary = std::move(tree);
          return Ok();
        });
      case BlockKind::kDocumentNorms:  // follow from the words
        return Take(DecodeDocumentNorms(bytes, entry, what), [](const std::vector<float>&) { return Ok(); });
      case BlockKind::kWords:
        return Take(DecodeWordBlock(bytes, entry, directory, what), [&](const WordBlock& words) -> Status {
          // The tree comes before the words.
          if (rows_.vocabulary.nodes.empty())
            return MakeError(ErrorCode::kCorrupt, "{}: words without a tree", what);
          for (size_t i = 0; i < words.num_words(); ++i) {
            num_bytes_left_ -= static_cast<int64_t>(words.NumPostings(i) * sizeof(Posting));
            if (num_bytes_left_ < 0) return TooMuch();
            rows_.vocabulary.inverted_files[words.first + i] = words.Postings(i);
          }
          return Ok();
        });
      case BlockKind::kImages:
        return Take(DecodeImageBlock(bytes, entry, directory, what), [&](ImageBlock images) {
          std::move(images.images.begin(), images.images.end(), std::back_inserter(rows_.images));
          return Ok();
        });
      case BlockKind::kLandmarks:
        return Take(DecodeLandmarkBlock(bytes, entry, directory, what),
                    [&](LandmarkBlock block) { return AddLandmarks(block); });
      case BlockKind::kAppearance:
        return Take(DecodeAppearanceBlock(bytes, entry, directory, what), [&](AppearanceBlock part) {
          std::move(part.nodes.begin(), part.nodes.end(), std::back_inserter(rows_.appearance));
          return Ok();
        });
      case BlockKind::kAmbiguity:  // comes after the nodes
        return Take(DecodeAmbiguityBlock(bytes, entry, directory, what),
                    [&](AmbiguityBlock block) { return AddAmbiguity(std::move(block)); });
      case BlockKind::kFloorPlan:
        return Take(DecodeFloorPlan(bytes, entry, directory, what), [&](FloorPlan plan) {
          rows_.views.plan = std::move(plan);
          return Ok();
        });
      case BlockKind::kViewRegions:
        return Take(DecodeViewBlock(bytes, entry, directory, what),
                    [&](const ViewBlock& regions) { return AppendRegions(regions, what, &rows_.views); });
      case BlockKind::kLandmarkModels:
        return Take(DecodeVisualBlock(bytes, entry, directory, what),
                    [&](const VisualBlock& models) { return AppendModels(models, what, &rows_.visual_map); });
    }
    return Ok();  // of a later minor version
  }

  // Passes a decoded block to `add` if there is memory left for it: a few bytes of a block can stand for
  // lists of millions.
  template <typename Block, typename Add>
  Status Take(Result<Block> block, Add&& add) {
    CAIRN_RETURN_IF_ERROR(block);
    num_bytes_left_ -= NumBytes(*block);
    if (num_bytes_left_ < 0) return TooMuch();
    return add(*std::move(block));
  }

  Error TooMuch() const {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: its blocks decode to more than {} times its size: not a map that cairn wrote",
                     file_.path(), kMostUnfolding);
  }

  // Postings name images in a file, but documents in rows.
  Status NameDocuments() {
    const std::vector<char> is_document = DocumentImages(rows_);
    std::vector<int32_t> document_of_image(rows_.images.size(), -1);
    for (size_t i = 0; i < rows_.images.size(); ++i) {
      if (!is_document[i]) continue;
      document_of_image[i] = static_cast<int32_t>(rows_.vocabulary.document_ids.size());
      rows_.vocabulary.document_ids.push_back(rows_.images[i].image_id);
    }
    for (std::vector<Posting>& postings : rows_.vocabulary.inverted_files) {
      for (Posting& posting : postings) {
        const int32_t document = document_of_image[posting.document];
        if (document < 0) {
          return MakeError(ErrorCode::kCorrupt, "image {} has words, but is not kept", posting.document);
        }
        posting.document = document;
      }
    }
    return Ok();
  }

  Status AddStations(const StationBlock& block) {
    for (size_t i = 0; i < block.stations.size(); ++i) {
      const auto station = static_cast<StationIdx>(block.first + i);
      rows_.stations.push_back(block.stations[i]);
      for (const StationIdx neighbour : block.neighbours[i])
        rows_.station_edges.emplace_back(station, neighbour);
      for (const RegionIdx region : block.regions[i]) rows_.regions[region].stations.push_back(station);
    }
    return Ok();
  }

  Status AddAmbiguity(AmbiguityBlock block) {
    for (size_t i = 0; i < block.nodes.size() && block.first + i < rows_.appearance.size(); ++i) {
      rows_.appearance[block.first + i].entropy = block.nodes[i].entropy;
      rows_.appearance[block.first + i].look_alikes = std::move(block.nodes[i].look_alikes);
    }
    return Ok();
  }

  Status AddLandmarks(const LandmarkBlock& block) {
    if (block.first > 0 && block.descriptor_code != rows_.descriptor_code) {
      return MakeError(ErrorCode::kCorrupt, "{}: its blocks of landmarks are coded in different ways",
                       file_.path());
    }
    rows_.descriptor_code = block.descriptor_code;
    rows_.landmarks.insert(rows_.landmarks.end(), block.landmarks.begin(), block.landmarks.end());
    rows_.descriptors.middleRows(block.first, block.descriptors.rows()) = block.descriptors;
    for (const auto& [region, landmarks] : block.regions) {
      std::vector<LandmarkIdx>& of_region = rows_.regions[region].landmarks;
      of_region.insert(of_region.end(), landmarks.begin(), landmarks.end());
    }
    return Ok();
  }

  const MapFile& file_;
  MapRows& rows_;
  int64_t num_bytes_left_;
};

}  // namespace

Result<MapRows> ReadMapRows(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const MapFile file, MapFile::Open(path, {}));
  return ReadMapRows(file);
}

Result<MapRows> ReadMapRows(const MapFile& file) {
  MapRows rows;
  const Status status = RowsReader(file, &rows).Read();
  if (status.ok()) return rows;
  // CheckMapRows does not know of the file.
  const bool names_file = status.error().message.find(file.path()) != std::string::npos;
  const ErrorCode code = status.error().code;
  return MakeError(code == ErrorCode::kInvalidArgument ? ErrorCode::kCorrupt : code, "{}{}",
                   names_file ? "" : file.path() + ": ", status.error().message);
}

}  // namespace cairn
