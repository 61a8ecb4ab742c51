#include "core/vocabulary/vocabulary_tree.h"

#include <cmath>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/files/file.h"
#include "stages/build_vocabulary/build_vocabulary.h"

namespace cairn::build_vocabulary {
namespace {

DescriptorMatrix RandomDescriptors(int count, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(count, kSiftDescriptorDim);
  for (int row = 0; row < count; ++row) {
    for (int i = 0; i < kSiftDescriptorDim; ++i)
      descriptors(row, i) = static_cast<uint8_t>(random.UniformInt(0, 90));
  }
  return descriptors;
}

// Two levels, two words on the left and one on the right, told apart by dimensions 0, 1 and 2:
//          root
//        1      2 (word 0)
//      3   4              (words 1, 2)
Vocabulary HandMadeTree() {
  Vocabulary tree;
  tree.branching = 2;
  tree.depth = 2;
  tree.nodes.resize(5);
  tree.nodes[0].num_children = 2;
  tree.nodes[1].num_children = 2;
  tree.centres = DescriptorMatrix::Zero(5, kSiftDescriptorDim);
  tree.centres(1, 0) = 200;
  tree.centres(1, 1) = 200;
  tree.centres(2, 2) = 255;
  tree.centres(3, 0) = 255;
  tree.centres(4, 1) = 255;
  EXPECT_TRUE(NumberVocabularyNodes(&tree).ok());
  tree.document_ids = {5, 9};
  tree.inverted_files[0] = {{0, 1}, {1, 1}};
  tree.inverted_files[1] = {{0, 2}};
  tree.inverted_files[2] = {{1, 3}};
  WeightVocabulary(&tree);
  return tree;
}

DescriptorMatrix Unit(int dimension) {
  DescriptorMatrix descriptor = DescriptorMatrix::Zero(1, kSiftDescriptorDim);
  descriptor(0, dimension) = 255;
  return descriptor;
}

TEST(VocabularyTree, ChildrenThatDoNotFitTheNodesAreAnError) {
  const auto said = [](const std::vector<int32_t>& num_children) {
    Vocabulary tree;
    for (const int32_t num : num_children) tree.nodes.push_back({.num_children = num});
    const Status status = NumberVocabularyNodes(&tree);
    return status.ok() ? "" : status.error().message;
  };
  EXPECT_EQ(said({}), "");
  EXPECT_EQ(said({0}), "");
  EXPECT_EQ(said({3, 0, 1, 0, 0}), "");
  EXPECT_EQ(said({1}), "vocabulary node 0: 1 children do not fit 1 nodes");
  EXPECT_EQ(said({2, 0}), "vocabulary node 0: 2 children do not fit 2 nodes");
  EXPECT_EQ(said({-1, 0}), "vocabulary node 0: -1 children do not fit 2 nodes");
  EXPECT_EQ(said({1, 0, 1, 0}), "vocabulary node 2: 1 children do not fit 4 nodes");  // before its children
  EXPECT_EQ(said({1, 0, 0}), "vocabulary: 3 nodes, but children for 2");
}

TEST(VocabularyTree, DescriptorFallsToTheNearestLeaf) {
  const Vocabulary tree = HandMadeTree();
  EXPECT_EQ(QuantizeDescriptor(tree, Unit(0).data()), 1);
  EXPECT_EQ(QuantizeDescriptor(tree, Unit(1).data()), 2);
  EXPECT_EQ(QuantizeDescriptor(tree, Unit(2).data()), 0);
  EXPECT_EQ(QuantizeDescriptor(tree, Unit(9).data()), 1);  // ties go to the first child
  EXPECT_EQ(QuantizeDescriptor(Vocabulary(), Unit(0).data()), -1);
}

TEST(VocabularyTree, ScoresByHand) {
  // idf: word 0 is in both documents, ln 1 = 0; words 1 and 2 have ln 2.  Documents are (2 ln 2) e1 and (3 ln
  // 2) e2, so a query of one word 1 and one word 2 makes 45 degrees with both.
  const Vocabulary tree = HandMadeTree();
  DescriptorMatrix query(2, kSiftDescriptorDim);
  query << Unit(0), Unit(1);
  const auto scored = QueryVocabulary(tree, query, 10);
  ASSERT_EQ(scored.size(), 2u);
  EXPECT_EQ(scored[0].document, 0);  // tie: the smaller document first
  EXPECT_NEAR(scored[0].score, std::sqrt(0.5), 1e-6);
  EXPECT_NEAR(scored[1].score, std::sqrt(0.5), 1e-6);
  EXPECT_EQ(QueryVocabulary(tree, query, 1).size(), 1u);
  EXPECT_TRUE(QueryVocabulary(tree, query, 0).empty());
  EXPECT_TRUE(QueryVocabulary(tree, query, -1).empty());
  EXPECT_NEAR(QueryVocabulary(tree, Unit(1), 10)[0].score, 1, 1e-6);
  EXPECT_TRUE(QueryVocabulary(tree, Unit(2), 10).empty());  // only word 0, which weighs nothing
}

TEST(VocabularyTree, ScoresEqualBruteForceOverDenseVectors) {
  std::vector<ImageDescriptors> images;
  for (int i = 0; i < 9; ++i)
    images.push_back({static_cast<ImageId>(i + 1), RandomDescriptors(60 + 5 * i, i)});
  NoProgress progress;
  BuildVocabularyOptions options;
  options.tree.depth = 2;
  const Vocabulary vocabulary = *BuildVocabulary(images, {}, options, 0, 1, progress);
  const int num_words = vocabulary.num_words();

  // Oracle: dense, L2-normalised tf-idf vectors; score 1 - |q - d|^2 / 2.
  const auto counts = [&](const DescriptorMatrix& descriptors) {
    Eigen::VectorXd vector = Eigen::VectorXd::Zero(num_words);
    for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
      vector[QuantizeDescriptor(vocabulary, descriptors.row(i).data())] += 1;
    }
    return vector;
  };
  Eigen::VectorXd documents_with_word = Eigen::VectorXd::Zero(num_words);
  for (const ImageDescriptors& image : images) {
    documents_with_word += (counts(image.descriptors).array() > 0).cast<double>().matrix();
  }
  const Eigen::VectorXd idf =
      documents_with_word.unaryExpr([](double n) { return n > 0 ? std::log(9 / n) : 0; });
  const auto weighted = [&](const DescriptorMatrix& descriptors) {
    return Eigen::VectorXd(counts(descriptors).cwiseProduct(idf).normalized());
  };

  const DescriptorMatrix query = RandomDescriptors(80, 99);
  std::map<int, double> expected;
  for (int i = 0; i < 9; ++i) {
    expected[i] = 1 - 0.5 * (weighted(query) - weighted(images[i].descriptors)).squaredNorm();
  }
  const auto scored = QueryVocabulary(vocabulary, query, 100);
  ASSERT_EQ(scored.size(), 9u);
  for (size_t i = 0; i < scored.size(); ++i) {
    EXPECT_NEAR(scored[i].score, expected[scored[i].document], 1e-5);
    if (i > 0) {
      EXPECT_GE(scored[i - 1].score, scored[i].score);
    }
  }
}

TEST(VocabularyTree, ImageOfTheSurveyFindsItself) {
  std::vector<ImageDescriptors> images;
  for (int i = 0; i < 20; ++i) images.push_back({static_cast<ImageId>(i + 1), RandomDescriptors(50, i)});
  NoProgress progress;
  BuildVocabularyOptions options;
  options.tree.depth = 3;
  const Vocabulary vocabulary = *BuildVocabulary(images, {}, options, 0, 1, progress);
  for (int i = 0; i < 20; ++i) {
    const auto scored = QueryVocabulary(vocabulary, images[i].descriptors, 1);
    ASSERT_EQ(scored.size(), 1u);
    EXPECT_EQ(scored[0].document, i);
    EXPECT_NEAR(scored[0].score, 1, 1e-5);
  }
}

TEST(VocabularyTree, FileRoundTripKeepsEverything) {
  const std::string path = testing::TempDir() + "/round_trip.db";
  Vocabulary written = HandMadeTree();
  written.depth = 3;  // not reached everywhere
  ASSERT_TRUE(WriteVocabulary(written, path).ok());
  const Result<Vocabulary> read = ReadVocabulary(path);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->centres, written.centres);
  EXPECT_EQ(read->inverted_files, written.inverted_files);
  EXPECT_EQ(read->document_ids, written.document_ids);
  EXPECT_EQ(read->idf, written.idf);
  EXPECT_EQ(read->document_num_words, (std::vector<int32_t>{2, 2}));
  EXPECT_EQ(read->branching, 2);
  EXPECT_EQ(read->depth, 3);
}

// What reading HandMadeTree says after `sql` was done to its file.
Result<Vocabulary> ReadAfter(const std::string& sql) {
  const std::string path = testing::TempDir() + "/damaged.db";
  EXPECT_TRUE(WriteVocabulary(HandMadeTree(), path).ok());
  SQLite::Database(path, SQLite::OPEN_READWRITE).exec(sql);
  return ReadVocabulary(path);
}

void ExpectCorrupt(const std::string& sql, const std::string& message) {
  SCOPED_TRACE(sql);
  const Result<Vocabulary> read = ReadAfter(sql);
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(read.error().message, testing::HasSubstr("damaged.db"));
  EXPECT_THAT(read.error().message, testing::HasSubstr(message));
}

// A table of the same rows, and of `more`, whose key lets a node or a word have several.
std::string WithManyRows(const std::string& table, const std::string& columns, const std::string& more) {
  return fmt::format(
      "CREATE TABLE plain ({1}, PRIMARY KEY ({1})) WITHOUT ROWID; INSERT INTO plain SELECT * FROM {0}; DROP "
      "TABLE {0}; ALTER TABLE plain RENAME TO {0}; INSERT INTO {0} {2}",
      table, columns, more);
}

TEST(VocabularyTree, DamagedNodesAreRefused) {
  const auto nodes = [](const std::string& sql) { return "UPDATE vocabulary_nodes SET " + sql; };
  ExpectCorrupt("UPDATE vocabulary SET num_nodes = -1", "vocabulary of -1 nodes");
  ExpectCorrupt("UPDATE vocabulary SET num_nodes = 0", "vocabulary_nodes 0: 2 children");
  ExpectCorrupt("UPDATE vocabulary SET num_nodes = 4", "vocabulary_nodes 1: 2 children with 256 bytes");
  ExpectCorrupt("UPDATE vocabulary SET num_nodes = 6", "vocabulary of 6 nodes, found 5");
  ExpectCorrupt("UPDATE vocabulary SET num_nodes = 100000000", "vocabulary of 100000000 nodes, found 5");
  ExpectCorrupt("UPDATE vocabulary SET num_nodes = 100000001", "vocabulary of 100000001 nodes");
  ExpectCorrupt("DELETE FROM vocabulary_nodes", "vocabulary of 5 nodes, found 1");
  ExpectCorrupt(nodes("node_id = -1 WHERE node_id = 0"), "vocabulary_nodes -1: 2 children");
  ExpectCorrupt(nodes("node_id = 5 WHERE node_id = 1"), "vocabulary_nodes 5: 2 children");
  ExpectCorrupt(nodes("node_id = 4 WHERE node_id = 1"), "node 4: 2 children do not fit 5 nodes");
  ExpectCorrupt(nodes("num_children = 0 WHERE node_id = 1"), "vocabulary_nodes 1: 0 children");
  ExpectCorrupt(nodes("num_children = 3, centres = zeroblob(384) WHERE node_id = 1"),
                "vocabulary_nodes 1: 3 children with 384 bytes");
  ExpectCorrupt(nodes("num_children = 3 WHERE node_id = 0"), "vocabulary_nodes 0: 3 children with 256 bytes");
  ExpectCorrupt(nodes("centres = zeroblob(257) WHERE node_id = 1"), "2 children with 257 bytes");
  // The second row of a node would have other children in the place of the first one's.
  ExpectCorrupt(
      WithManyRows("vocabulary_nodes", "node_id, num_children, centres", "VALUES (0, 1, zeroblob(128))") +
          "; UPDATE vocabulary_nodes SET num_children = 1, centres = zeroblob(128) WHERE node_id = 1",
      "vocabulary_nodes 0: ");
}

TEST(VocabularyTree, DamagedWordsAreRefused) {
  const auto word_1 = [](const std::string& sql) {
    return "UPDATE vocabulary_words SET " + sql + " WHERE word_id = 1";
  };
  const std::string refused = "are not ascending documents below 2 with counts";
  // As it is: one posting, the document -1 + 1, twice.
  ExpectCorrupt(word_1("postings = x'0505'"), "vocabulary_words 1: 1 postings in 2 bytes " + refused);
  for (const char* postings : {"x'0002'", "x'0302'", "x'0100'", "x''", "x'01'", "x'010201'",
                               "x'ffffffffffffffffffffff'", "x'018080808008'", "'words'"}) {
    ExpectCorrupt(word_1(std::string("postings = ") + postings), refused);
  }
  ExpectCorrupt(word_1("num_postings = 2, postings = x'01020201'"), refused);  // the documents 0 and 2
  ExpectCorrupt(word_1("num_postings = 2"), refused);
  ExpectCorrupt(word_1("num_postings = 0, postings = x''"), refused);
  ExpectCorrupt(word_1("num_postings = 1000000000"), refused);
  ExpectCorrupt(word_1("word_id = -1"), "vocabulary_words -1: ");
  ExpectCorrupt(word_1("word_id = 3"), "vocabulary_words 3: ");
  ExpectCorrupt(WithManyRows("vocabulary_words", "word_id, num_postings, postings", "VALUES (1, 1, x'0101')"),
                "vocabulary_words 1: ");

  const Result<Vocabulary> most = ReadAfter(word_1("num_postings = 2, postings = x'010101ffffffff07'"));
  ASSERT_TRUE(most.ok()) << most.error().message;
  EXPECT_THAT(most->inverted_files[1], testing::ElementsAre(Posting{0, 1}, Posting{1, INT32_MAX}));
  const Result<Vocabulary> last = ReadAfter(word_1("postings = x'0202'"));
  ASSERT_TRUE(last.ok()) << last.error().message;
  EXPECT_THAT(last->inverted_files[1], testing::ElementsAre(Posting{1, 2}));
}

TEST(VocabularyTree, DamagedDocumentsAreRefused) {
  const auto second = [](const std::string& sql) {
    return "UPDATE vocabulary_documents SET " + sql + " WHERE document_idx = 1";
  };
  ExpectCorrupt(second("image_id = 1"), "vocabulary_documents 1: image 1 is out of order");
  ExpectCorrupt(second("image_id = 5"), "vocabulary_documents 1: image 5 is out of order");
  ExpectCorrupt(second("image_id = 4294967295"), "image 4294967295 is out of order");
  ExpectCorrupt(second("document_idx = 2"), "vocabulary_documents 2: ");
  ExpectCorrupt("UPDATE vocabulary_documents SET image_id = -1 WHERE document_idx = 0",
                "image -1 is out of order");
  ExpectCorrupt("UPDATE vocabulary SET num_words = 2", "states 2 words and 2 documents, found 3 and 2");
  ExpectCorrupt("UPDATE vocabulary SET num_documents = 3", "states 3 words and 3 documents, found 3 and 2");
  ExpectCorrupt("DELETE FROM vocabulary", "table 'vocabulary' is empty");
  ExpectCorrupt("DROP TABLE vocabulary", "has no table 'vocabulary'");
  EXPECT_TRUE(ReadAfter(second("image_id = 4294967294")).ok());
}

}  // namespace
}  // namespace cairn::build_vocabulary
