// Vocabularies in SQLite: the tables of schemas/vocabulary.sql.
#include <optional>

#include "core/base/blob.h"
#include "core/features/descriptor_kind_table.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "schemas/vocabulary_sql.h"

namespace cairn {
namespace {

constexpr int64_t kMaxNodes = 100'000'000;

std::string_view BlobView(const SQLite::Column& column) {
  return {static_cast<const char*>(column.getBlob()), static_cast<size_t>(column.getBytes())};
}

Status ReadNodes(SQLite::Database& database, const std::string& path, int64_t num_nodes,
                 Vocabulary* vocabulary) {
  struct Row {
    int64_t node_id;
    int64_t num_children;
    std::string centres;
  };
  std::vector<Row> rows;
  const int num_values = vocabulary->kind.num_values;
  LimitedStatement query(database,
                         "SELECT node_id, num_children, centres FROM vocabulary_nodes ORDER BY node_id");
  int64_t next_id = 0, num_counted = std::min<int64_t>(num_nodes, 1);  // with the root
  while (query.executeStep()) {
    const int64_t node_id = query.getColumn(0).getInt64();
    const int64_t num_children = query.getColumn(1).getInt64();
    const std::string_view centres = BlobView(query.getColumn(2));
    if (node_id < next_id || node_id >= num_nodes || num_children < 1 ||
        num_children > num_nodes - num_counted ||
        static_cast<int64_t>(centres.size()) != num_children * num_values) {
      return MakeError(ErrorCode::kCorrupt, "{}: vocabulary_nodes {}: {} children with {} bytes of centres",
                       path, node_id, num_children, centres.size());
    }
    next_id = node_id + 1;
    num_counted += num_children;
    rows.push_back({node_id, num_children, std::string(centres)});
  }
  // Nothing of a size that the file only claims is allocated.
  if (num_counted != num_nodes) {
    return MakeError(ErrorCode::kCorrupt, "{}: vocabulary of {} nodes, found {}", path, num_nodes,
                     num_counted);
  }
  vocabulary->nodes.resize(num_nodes);
  for (const Row& row : rows)
    vocabulary->nodes[row.node_id].num_children = static_cast<int32_t>(row.num_children);
  if (Status status = NumberVocabularyNodes(vocabulary); !status.ok()) {
    return MakeError(ErrorCode::kCorrupt, "{}: {}", path, status.error().message);
  }
  vocabulary->centres = DescriptorMatrix::Zero(num_nodes, num_values);
  for (const Row& row : rows) {
    std::memcpy(vocabulary->centres.row(vocabulary->nodes[row.node_id].first_child).data(),
                row.centres.data(), row.centres.size());
  }
  return Ok();
}

Status ReadWords(SQLite::Database& database, const std::string& path, int64_t num_documents,
                 Vocabulary* vocabulary) {
  LimitedStatement query(database,
                         "SELECT word_id, num_postings, postings FROM vocabulary_words ORDER BY word_id");
  int64_t next_word = 0;
  while (query.executeStep()) {
    const int64_t word = query.getColumn(0).getInt64();
    const int64_t num_postings = query.getColumn(1).getInt64();
    const std::string_view bytes = BlobView(query.getColumn(2));
    const Error corrupt = MakeError(ErrorCode::kCorrupt,
                                    "{}: vocabulary_words {}: {} postings in {} bytes are not "
                                    "ascending documents below {} with counts",
                                    path, word, num_postings, bytes.size(), num_documents);
    if (word < next_word || word >= vocabulary->num_words() || num_postings < 1 ||
        num_postings > static_cast<int64_t>(bytes.size()) / 2) {
      return corrupt;
    }
    next_word = word + 1;
    BlobReader reader(bytes);
    int64_t document = -1;
    for (int64_t i = 0; i < num_postings; ++i) {
      const uint64_t step = reader.Varint();
      const uint64_t count = reader.Varint();
      if (step == 0 || step > static_cast<uint64_t>(num_documents) || count == 0 || count > INT32_MAX)
        return corrupt;
      document += static_cast<int64_t>(step);
      if (document >= num_documents) return corrupt;
      vocabulary->inverted_files[word].push_back(
          {static_cast<int32_t>(document), static_cast<int32_t>(count)});
    }
    if (!reader.Finished()) return corrupt;
  }
  return Ok();
}

Status ReadDocuments(SQLite::Database& database, const std::string& path, Vocabulary* vocabulary) {
  LimitedStatement query(database,
                         "SELECT document_idx, image_id FROM vocabulary_documents ORDER BY document_idx");
  while (query.executeStep()) {
    const int64_t document = query.getColumn(0).getInt64();
    const int64_t image_id = query.getColumn(1).getInt64();
    if (document != static_cast<int64_t>(vocabulary->document_ids.size()) || image_id < 0 ||
        image_id >= kInvalidImageId || (document > 0 && image_id <= vocabulary->document_ids.back())) {
      return MakeError(ErrorCode::kCorrupt, "{}: vocabulary_documents {}: image {} is out of order", path,
                       document, image_id);
    }
    vocabulary->document_ids.push_back(static_cast<ImageId>(image_id));
  }
  return Ok();
}

}  // namespace

const char* const kVocabularySchema = kVocabularySql;

Result<Vocabulary> ReadVocabularyTables(SQLite::Database& database, const std::string& path) {
  if (!HasTable(database, "vocabulary")) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: has no table 'vocabulary'; expected what build-vocabulary writes", path);
  }
  Vocabulary vocabulary;
  CAIRN_ASSIGN_OR_RETURN(vocabulary.kind, ReadDescriptorKind(database, path));
  LimitedStatement head(database,
                        "SELECT branching, depth, num_nodes, num_words, num_documents FROM vocabulary");
  if (!head.executeStep()) return MakeError(ErrorCode::kCorrupt, "{}: table 'vocabulary' is empty", path);
  vocabulary.branching = head.getColumn(0).getInt();
  vocabulary.depth = head.getColumn(1).getInt();
  const int64_t num_nodes = head.getColumn(2).getInt64();
  const int64_t num_words = head.getColumn(3).getInt64();
  const int64_t num_documents = head.getColumn(4).getInt64();
  if (num_nodes < 0 || num_nodes > kMaxNodes) {
    return MakeError(ErrorCode::kCorrupt, "{}: vocabulary of {} nodes", path, num_nodes);
  }
  CAIRN_RETURN_IF_ERROR(ReadNodes(database, path, num_nodes, &vocabulary));
  CAIRN_RETURN_IF_ERROR(ReadDocuments(database, path, &vocabulary));
  if (num_words != vocabulary.num_words() ||
      num_documents != static_cast<int64_t>(vocabulary.document_ids.size())) {
    return MakeError(ErrorCode::kCorrupt, "{}: vocabulary states {} words and {} documents, found {} and {}",
                     path, num_words, num_documents, vocabulary.num_words(), vocabulary.document_ids.size());
  }
  CAIRN_RETURN_IF_ERROR(ReadWords(database, path, num_documents, &vocabulary));
  WeightVocabulary(&vocabulary);
  return vocabulary;
}

void WriteVocabularyTables(SQLite::Database& database, const Vocabulary& vocabulary) {
  WriteDescriptorKind(database, vocabulary.kind);
  SQLite::Statement head(database, "INSERT INTO vocabulary VALUES (?, ?, ?, ?, ?)");
  head.bind(1, vocabulary.branching);
  head.bind(2, vocabulary.depth);
  head.bind(3, static_cast<int64_t>(vocabulary.nodes.size()));
  head.bind(4, vocabulary.num_words());
  head.bind(5, static_cast<int64_t>(vocabulary.document_ids.size()));
  head.exec();

  SQLite::Statement insert_node(database, "INSERT INTO vocabulary_nodes VALUES (?, ?, ?)");
  for (size_t i = 0; i < vocabulary.nodes.size(); ++i) {
    const VocabularyNode& node = vocabulary.nodes[i];
    if (node.num_children == 0) continue;
    insert_node.bind(1, static_cast<int64_t>(i));
    insert_node.bind(2, node.num_children);
    insert_node.bind(3, vocabulary.centres.row(node.first_child).data(),
                     node.num_children * vocabulary.kind.num_values);
    insert_node.exec();
    insert_node.reset();
  }

  SQLite::Statement insert_word(database, "INSERT INTO vocabulary_words VALUES (?, ?, ?)");
  for (int word = 0; word < vocabulary.num_words(); ++word) {
    const std::vector<Posting>& postings = vocabulary.inverted_files[word];
    if (postings.empty()) continue;
    BlobWriter writer;
    int32_t previous = -1;
    for (const Posting& posting : postings) {
      writer.Varint(static_cast<uint64_t>(posting.document - previous));
      writer.Varint(static_cast<uint64_t>(posting.count));
      previous = posting.document;
    }
    const std::string blob = writer.Take();
    insert_word.bind(1, word);
    insert_word.bind(2, static_cast<int64_t>(postings.size()));
    insert_word.bind(3, blob.data(), static_cast<int>(blob.size()));
    insert_word.exec();
    insert_word.reset();
  }

  SQLite::Statement insert_document(database, "INSERT INTO vocabulary_documents VALUES (?, ?)");
  for (size_t i = 0; i < vocabulary.document_ids.size(); ++i) {
    insert_document.bind(1, static_cast<int64_t>(i));
    insert_document.bind(2, static_cast<int64_t>(vocabulary.document_ids[i]));
    insert_document.exec();
    insert_document.reset();
  }
}

Result<Vocabulary> ReadVocabulary(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&] { return ReadVocabularyTables(database, path); });
}

Status WriteVocabulary(const Vocabulary& vocabulary, const std::string& path) {
  return WriteDatabase(path, kVocabularySchema, [&](SQLite::Database& database) -> Status {
    WriteVocabularyTables(database, vocabulary);
    return Ok();
  });
}

}  // namespace cairn
