// Whole maps read: all blocks of a map file as rows.
#include "core/map_documents.h"
#include "core/map_file.h"
#include "core/map_rows.h"

namespace cairn {
namespace {

class RowsReader {
 public:
  RowsReader(const MapFile& file, MapRows* rows) : file_(file), rows_(*rows) {}

  Status Read() {
    static_cast<MapHead&>(rows_) = file_.head();
    const MapDirectory& directory = file_.directory();
    rows_.regions.resize(directory.Count(BlockKind::kRegions));
    rows_.descriptors.resize(directory.Count(BlockKind::kLandmarks), kDescriptorDim);
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
        return AddStations(DecodeStationBlock(bytes, entry, directory, what));
      case BlockKind::kRegions:  // follow from the landmark blocks
        return ToStatus(DecodeRegionBlock(bytes, entry, directory, what));
      case BlockKind::kVocabularyTree: {
        CAIRN_ASSIGN_OR_RETURN(rows_.vocabulary, DecodeVocabularyTree(bytes, entry, directory, what));
        return Ok();
      }
      case BlockKind::kDocumentNorms:  // follow from the words
        return ToStatus(DecodeDocumentNorms(bytes, entry, what));
      case BlockKind::kWords: {
        CAIRN_ASSIGN_OR_RETURN(WordBlock words, DecodeWordBlock(bytes, entry, directory, what));
        // The tree stands before the words.
        if (rows_.vocabulary.nodes.empty())
          return MakeError(ErrorCode::kCorrupt, "{}: words without a tree", what);
        std::move(words.postings.begin(), words.postings.end(),
                  rows_.vocabulary.inverted_files.begin() + words.first);
        return Ok();
      }
      case BlockKind::kImages: {
        CAIRN_ASSIGN_OR_RETURN(ImageBlock images, DecodeImageBlock(bytes, entry, directory, what));
        std::move(images.images.begin(), images.images.end(), std::back_inserter(rows_.images));
        return Ok();
      }
      case BlockKind::kLandmarks:
        return AddLandmarks(DecodeLandmarkBlock(bytes, entry, directory, what));
      case BlockKind::kAppearance: {
        CAIRN_ASSIGN_OR_RETURN(AppearanceBlock part, DecodeAppearanceBlock(bytes, entry, directory, what));
        std::move(part.nodes.begin(), part.nodes.end(), std::back_inserter(rows_.appearance));
        return Ok();
      }
      case BlockKind::kAmbiguity:  // stands after the nodes
        return AddAmbiguity(DecodeAmbiguityBlock(bytes, entry, directory, what));
      case BlockKind::kFloorPlan: {
        CAIRN_ASSIGN_OR_RETURN(rows_.views.plan, DecodeFloorPlan(bytes, entry, directory, what));
        return Ok();
      }
      case BlockKind::kViewRegions: {
        CAIRN_ASSIGN_OR_RETURN(const ViewBlock regions, DecodeViewBlock(bytes, entry, directory, what));
        return AppendRegions(regions, what, &rows_.views);
      }
      case BlockKind::kLandmarkModels: {
        CAIRN_ASSIGN_OR_RETURN(const VisualBlock models, DecodeVisualBlock(bytes, entry, directory, what));
        return AppendModels(models, what, &rows_.visual_map);
      }
    }
    return Ok();  // of a later minor version
  }

  // Postings name images in a file, documents in rows.
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

  template <typename T>
  static Status ToStatus(const Result<T>& result) {
    return result.ok() ? Ok() : Status(result.error());
  }

  Status AddStations(const Result<StationBlock>& block) {
    CAIRN_RETURN_IF_ERROR(block);
    for (size_t i = 0; i < block->stations.size(); ++i) {
      const auto station = static_cast<StationIdx>(block->first + i);
      rows_.stations.push_back(block->stations[i]);
      for (const StationIdx neighbour : block->neighbours[i])
        rows_.station_edges.emplace_back(station, neighbour);
      for (const RegionIdx region : block->regions[i]) rows_.regions[region].stations.push_back(station);
    }
    return Ok();
  }

  Status AddAmbiguity(Result<AmbiguityBlock> block) {
    CAIRN_RETURN_IF_ERROR(block);
    for (size_t i = 0; i < block->nodes.size() && block->first + i < rows_.appearance.size(); ++i) {
      rows_.appearance[block->first + i].entropy = block->nodes[i].entropy;
      rows_.appearance[block->first + i].look_alikes = std::move(block->nodes[i].look_alikes);
    }
    return Ok();
  }

  Status AddLandmarks(const Result<LandmarkBlock>& block) {
    CAIRN_RETURN_IF_ERROR(block);
    rows_.landmarks.insert(rows_.landmarks.end(), block->landmarks.begin(), block->landmarks.end());
    rows_.descriptors.middleRows(block->first, block->descriptors.rows()) = block->descriptors;
    for (const auto& [region, landmarks] : block->regions) {
      std::vector<LandmarkIdx>& of_region = rows_.regions[region].landmarks;
      of_region.insert(of_region.end(), landmarks.begin(), landmarks.end());
    }
    return Ok();
  }

  const MapFile& file_;
  MapRows& rows_;
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
  // CheckMapRows does not know the file.
  const bool names_file = status.error().message.find(file.path()) != std::string::npos;
  return MakeError(ErrorCode::kCorrupt, "{}{}", names_file ? "" : file.path() + ": ", status.error().message);
}

}  // namespace cairn
