#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "core/world/dropped_items.h"
#include "tests/match_features/features_fixture.h"

namespace cairn::match_features {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

TEST_F(MatchFeaturesTest, FindsAllPairsWithAndWithoutPoses) {
  WriteFeatures(4);
  for (const bool with_poses : {true, false}) {
    const auto summary = Match(with_poses);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
    EXPECT_EQ(summary->pairs, with_poses ? "frustum" : "exhaustive");
    EXPECT_EQ(summary->num_pairs_verified, 6);
    EXPECT_GE(summary->num_inliers, 6 * 75);
    auto database = OpenDatabaseReadOnly(folder_ + "/matches.db");
    const auto geometries = ReadDatabaseTwoViewGeometries(*database, 15);
    ASSERT_EQ(geometries->size(), 6u);
    for (const struct Match& match : geometries->front().inliers) EXPECT_EQ(match.idx1, match.idx2);
  }
}

TEST_F(MatchFeaturesTest, SameBytesForAnyNumberOfThreads) {
  WriteFeatures(5);
  ASSERT_TRUE(Match(false, 1).ok());
  const std::string one = *HashFile(folder_ + "/matches.db");
  ASSERT_TRUE(Match(false, 4).ok());
  EXPECT_EQ(*HashFile(folder_ + "/matches.db"), one);
}

TEST_F(MatchFeaturesTest, SameBytesForAnyMemoryBudget) {
  // 80 features of 176 bytes and 16 KiB of room each: a budget of 1 MiB holds 17 of 20 images at a time.
  WriteFeatures(20);
  options_.pairs = "exhaustive";
  ASSERT_TRUE(Match(true).ok());
  const std::string all_in_memory = *HashFile(folder_ + "/matches.db");
  options_.matching.memory_budget_mib = 1;
  ASSERT_TRUE(Match(true).ok());
  EXPECT_EQ(*HashFile(folder_ + "/matches.db"), all_in_memory);
}

TEST_F(MatchFeaturesTest, OfFewFeaturesAllAreLookedAt) {
  WriteFeatures(6);
  ASSERT_TRUE(Match(true).ok());
  const std::string by_default = *HashFile(folder_ + "/matches.db");
  for (const char* search : {"exact", "approximate"}) {
    options_.matching.search = search;
    for (const int budget_mib : {1, 512}) {
      options_.matching.memory_budget_mib = budget_mib;
      ASSERT_TRUE(Match(true).ok());
      EXPECT_EQ(*HashFile(folder_ + "/matches.db"), by_default) << search;
    }
  }
}

TEST_F(MatchFeaturesTest, ManyFeaturesAreSearchedByAnIndex) {
  num_points_ = ApproximateIndex::kMinNumDescriptors;
  WriteFeatures(3, [](SQLite::Database& database) {
    // One image has too few: all of it are looked at.
    for (const char* table : {"keypoints", "descriptors"}) {
      database.exec(
          fmt::format("UPDATE {0} SET rows = 500, data = substr(data, 1, 500 * length(data) / rows) "
                      "WHERE image_id = 3",
                      table));
    }
  });
  options_.matching.search = "approximate";
  options_.matching.verification.guided_matching = "none";
  const auto summary = Match(true);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->num_pairs_verified, 3);
  auto database = OpenDatabaseReadOnly(folder_ + "/matches.db");
  const auto geometries = ReadDatabaseTwoViewGeometries(*database, 15);
  ASSERT_EQ(geometries->size(), 3u);
  EXPECT_GT(geometries->front().inliers.size(), 0.95 * num_points_);
  for (const struct Match& match : geometries->front().inliers) EXPECT_EQ(match.idx1, match.idx2);
  EXPECT_GT(geometries->back().inliers.size(), 450u);
}

TEST_F(MatchFeaturesTest, FrustumGoesOnFromSeedsToThePairsTheyPredict) {
  // Each image with its two nearest first.  All see the same points, so that these pairs carry tracks from
  // the first image to the last.
  WriteFeatures(6);
  options_.num_frustum_seeds = 2;
  options_.num_frustum_scouts = 0;
  options_.min_num_expected_matches = 1000;
  const auto seeds = Match(true);
  ASSERT_TRUE(seeds.ok()) << seeds.error().message;
  EXPECT_EQ(seeds->pairs, "frustum");
  EXPECT_LT(seeds->num_pairs_tried, 12);
  options_.min_num_expected_matches = 10;
  const auto predicted = Match(true);
  ASSERT_TRUE(predicted.ok()) << predicted.error().message;
  EXPECT_EQ(predicted->num_pairs_verified, 15);
  auto database = OpenDatabaseReadOnly(folder_ + "/matches.db");
  EXPECT_EQ(ReadDatabaseTwoViewGeometries(*database, 15)->size(), 15u);
}

TEST_F(MatchFeaturesTest, PredictedPairsAreTheSameForAnyMemoryBudgetAndNumberOfThreads) {
  WriteFeatures(20);
  options_.num_frustum_seeds = 2;
  options_.num_frustum_scouts = 1;
  ASSERT_TRUE(Match(true, 1).ok());
  const std::string one = *HashFile(folder_ + "/matches.db");
  options_.matching.memory_budget_mib = 1;
  ASSERT_TRUE(Match(true, 4).ok());
  EXPECT_EQ(*HashFile(folder_ + "/matches.db"), one);
}

// Images that see the same, in sessions a, b, c, ... by turns; `matched` without those from a session on.
class MatchSessionsTest : public MatchFeaturesTest {
 protected:
  using NamePairs = std::set<std::pair<std::string, std::string>>;
  // Verified pairs, by name.
  NamePairs MatchUpTo(int num_images, char last_session) {
    capture_ = {};
    capture_.sessions = {"a", "b", "c", "d"};
    const auto name_of = [](int idx) { return fmt::format("{:c}/{}.png", 'a' + idx % 4, idx); };
    WriteFeatures(num_images, [&](SQLite::Database& database) {
      for (int idx = 0; idx < num_images; ++idx) {
        database.exec(
            fmt::format("UPDATE images SET name = '{}' WHERE image_id = {}", name_of(idx), idx + 1));
        if ('a' + idx % 4 > last_session)
          database.exec(fmt::format("DELETE FROM images WHERE image_id = {}", idx + 1));
      }
    });
    for (int idx = 0; idx < num_images; ++idx) capture_.images[idx].name = name_of(idx);
    EXPECT_TRUE(Match(true).ok());
    auto database = OpenDatabaseReadOnly(folder_ + "/matches.db");
    std::map<ImageId, std::string> names;
    const auto images = ReadDatabaseImages(*database);
    for (const DatabaseImage& image : *images) names[image.image_id] = image.name;
    NamePairs pairs;
    const auto geometries = ReadDatabaseTwoViewGeometries(*database, 15);
    for (const TwoViewGeometry& geometry : *geometries)
      pairs.emplace(names.at(geometry.image_id1), names.at(geometry.image_id2));
    return pairs;
  }
};

TEST_F(MatchSessionsTest, PairsStayWhenASessionIsAddedThatIsNotTheSecond) {
  options_.num_frustum_seeds = 1;
  options_.num_frustum_scouts = 1;
  const NamePairs three = MatchUpTo(24, 'c');
  NamePairs four = MatchUpTo(24, 'd');
  const size_t num_all = four.size();
  std::erase_if(four, [](const auto& pair) { return pair.first[0] == 'd' || pair.second[0] == 'd'; });
  EXPECT_EQ(four, three);
  EXPECT_LT(four.size(), num_all);
  // With the second, the first session's images have other seeds.
  EXPECT_LT(MatchUpTo(24, 'a').size(), MatchUpTo(24, 'b').size());
}

TEST_F(MatchSessionsTest, AnImageHasAsManyPartnersInAllEarlierSessionsAsInOne) {
  //   six images a session: 15 pairs within each, 36 of a and b, and six partners of each image of c and d
  options_.num_frustum_seeds = 2;
  options_.num_frustum_scouts = 0;
  const NamePairs pairs = MatchUpTo(24, 'd');
  std::map<std::string, std::map<char, int>> num_partners;
  for (const auto& [name1, name2] : pairs) {
    const auto [earlier, later] = std::minmax(name1, name2);
    ++num_partners[later][earlier[0]];
  }
  EXPECT_EQ(pairs.size(), 4 * 15 + 36 + 6 * 6 + 6 * 6);
  for (const auto& [name, by_session] : num_partners) {
    if (name[0] == 'd') {
      for (const char earlier : {'a', 'b', 'c'}) EXPECT_EQ(by_session.at(earlier), 2) << name;
    } else if (name[0] == 'c') {
      EXPECT_EQ(by_session.at('a'), 3) << name;
      EXPECT_EQ(by_session.at('b'), 3) << name;
    }
  }
  options_.earlier_partners_ratio = 2;
  EXPECT_EQ(MatchUpTo(24, 'd').size(), 4 * 15 + 36 + 6 * 12 + 6 * 12);
}

TEST_F(MatchFeaturesTest, SequenceWithLoopsAndAllImagesAgreeOnFewImages) {
  WriteFeatures(5);
  ASSERT_TRUE(Match(false).ok());
  const std::string exhaustive = *HashFile(folder_ + "/matches.db");
  options_.pairs = "sequence";
  ASSERT_TRUE(Match(false).ok());
  EXPECT_EQ(*HashFile(folder_ + "/matches.db"), exhaustive);
}

TEST_F(MatchFeaturesTest, RetrievalMatchesImagesThatShowTheSameWords) {
  // Images 1 and 2 show one place, 3 and 4 another.
  const auto other_place = [](SQLite::Database& database) {
    Random random(11);
    std::string bytes(80 * kSiftDescriptorDim, '\0');
    for (char& byte : bytes) byte = static_cast<char>(135 * std::pow(random.Uniform(), 4));
    SQLite::Statement update(database, "UPDATE descriptors SET data = ? WHERE image_id > 2");
    update.bind(1, bytes.data(), static_cast<int>(bytes.size()));
    update.exec();
  };
  WriteFeatures(4, other_place);
  options_.max_num_exhaustive_images = 3;
  const auto summary = Match(false);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->pairs, "retrieval");
  EXPECT_EQ(summary->num_pairs_tried, 2);
  auto database = OpenDatabaseReadOnly(folder_ + "/matches.db");
  const auto geometries = ReadDatabaseTwoViewGeometries(*database, 15);
  ASSERT_EQ(geometries->size(), 2u);
  EXPECT_EQ(geometries->at(0).image_id2, 2u);
  EXPECT_EQ(geometries->at(1).image_id1, 3u);
}

TEST_F(MatchFeaturesTest, LookAlikesAreMatchedByTheGeometryWhereItMayGuide) {
  // Points 0 and 1 look the same: of 80 points 78 are matched by their looks alone.
  const auto same_looks = [](SQLite::Database& database) {
    DescriptorMatrix descriptors = *ReadDatabaseDescriptors(database, 1);
    descriptors.row(1) = descriptors.row(0);
    SQLite::Statement update(database, "UPDATE descriptors SET data = ?");
    update.bind(1, descriptors.data(), static_cast<int>(descriptors.size()));
    update.exec();
  };
  WriteFeatures(2, same_looks);
  const auto num_inliers = [&](bool with_poses, const std::string& guided_matching) {
    options_.matching.verification.guided_matching = guided_matching;
    const auto summary = Match(with_poses);
    return summary.ok() ? summary->num_inliers : -1;
  };
  EXPECT_EQ(num_inliers(true, "none"), 78);
  EXPECT_EQ(num_inliers(true, "posed"), 80);
  EXPECT_EQ(num_inliers(false, "posed"), 78);
  EXPECT_EQ(num_inliers(false, "all"), 80);
}

TEST_F(MatchFeaturesTest, VocabularyWithoutWordsIsAnError) {
  WriteFeatures(3);
  Vocabulary vocabulary;
  vocabulary.nodes.resize(1);
  ASSERT_TRUE(NumberVocabularyNodes(&vocabulary).ok());
  vocabulary.centres = DescriptorMatrix::Zero(1, kSiftDescriptorDim);
  ASSERT_TRUE(WriteVocabulary(vocabulary, folder_ + "/vocabulary.db").ok());
  options_.pairs = "retrieval";
  inputs_.vocabulary_path = folder_ + "/vocabulary.db";
  const auto summary = Match(false);
  ASSERT_FALSE(summary.ok());
  EXPECT_EQ(summary.error().code, ErrorCode::kNoData);
  EXPECT_THAT(summary.error().message, HasSubstr("cannot distinguish images"));
  inputs_.vocabulary_path = folder_ + "/absent.db";
  EXPECT_EQ(Match(false).error().code, ErrorCode::kNotFound);
}

TEST_F(MatchFeaturesTest, ImagesWithoutFeaturesAreSkippedAndCounted) {
  WriteFeatures(3, [](SQLite::Database& database) {
    database.exec("UPDATE keypoints SET rows = 0, data = x'' WHERE image_id = 2");
    database.exec("DELETE FROM descriptors WHERE image_id = 2");
  });
  const auto summary = Match(true);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->num_images, 2);
  EXPECT_EQ(summary->num_without_features, 1);
  EXPECT_EQ(summary->num_pairs_verified, 1);
}

TEST_F(MatchFeaturesTest, PairsThatAreTriedAreVerifiedOrDroppedWithTheirReason) {
  // Image 2 has no features; image 4 turns away: descriptors match, the poses forbid it; of image 5 only ten
  // features are left.
  WriteFeatures(6, [](SQLite::Database& database) {
    database.exec("DELETE FROM keypoints WHERE image_id = 2; DELETE FROM descriptors WHERE image_id = 2");
    database.exec(
        "UPDATE keypoints SET rows = 10, data = substr(data, 1, length(data) / 8) WHERE image_id = 5");
    database.exec("UPDATE descriptors SET rows = 10, data = substr(data, 1, 1280) WHERE image_id = 5");
  });
  capture_.images[3].cam_from_world->rotation = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY());
  options_.pairs = "exhaustive";
  const auto summary = Match(true);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->num_pairs_tried, 10);  // of images 1, 3, 4, 5, 6
  const auto items = ReadDroppedItems(folder_ + "/matches.db", kColmapDroppedItemsTable);
  ASSERT_TRUE(items.ok()) << items.error().message;
  std::map<DropReason, std::set<std::pair<ImageId, ImageId>>> pairs;
  int num_images = 0;
  for (const DroppedItem& item : *items) {
    if (item.reason == DropReason::kNoFeatures) {
      ++num_images;
      EXPECT_EQ(item.item_id, 2);
      continue;
    }
    EXPECT_TRUE(pairs[item.reason].insert(ImageIdsFromPairId(item.item_id)).second);
    EXPECT_EQ(item.found, item.reason == DropReason::kFewMatches ? 10 : 80);
  }
  EXPECT_EQ(num_images, 1);
  EXPECT_THAT(pairs[DropReason::kFewMatches], testing::ElementsAre(std::pair(1u, 5u), std::pair(3u, 5u),
                                                                   std::pair(4u, 5u), std::pair(5u, 6u)));
  EXPECT_THAT(pairs[DropReason::kFewInliers],
              testing::ElementsAre(std::pair(1u, 4u), std::pair(3u, 4u), std::pair(4u, 6u)));
  EXPECT_EQ(summary->num_pairs_verified, 3);
  // Matching its own result again starts a new list.
  inputs_.features_path = folder_ + "/matches.db";
  NoProgress progress;
  ASSERT_TRUE(MatchFeatures(inputs_, options_, folder_ + "/again.db", 0, 1, progress).ok());
  EXPECT_EQ(*ReadDroppedItems(folder_ + "/again.db", kColmapDroppedItemsTable), *items);
}

TEST_F(MatchFeaturesTest, PairsThatShareOnlyAWatermarkAreDroppedAsSuch) {
  // Images 3 and 4 show a caption along the upper border, and nothing of what 1 and 2 show.
  WriteFeatures(4, [](SQLite::Database& database) {
    Random random(5);
    Features caption;
    caption.descriptors = *ReadDatabaseDescriptors(database, 3);
    for (int i = 0; i < 80; ++i) {
      caption.descriptors.row(i).reverseInPlace();
      caption.keypoints.push_back(
          {static_cast<float>(random.Uniform(5, 630)), static_cast<float>(random.Uniform(2, 50)), 2, 0});
    }
    database.exec("DELETE FROM keypoints WHERE image_id > 2; DELETE FROM descriptors WHERE image_id > 2");
    WriteDatabaseFeatures(database, 3, caption);
    WriteDatabaseFeatures(database, 4, caption);
  });
  options_.pairs = "exhaustive";
  const auto summary = Match(false);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->num_pairs_verified, 1);
  const auto items = ReadDroppedItems(folder_ + "/matches.db", kColmapDroppedItemsTable);
  ASSERT_TRUE(items.ok()) << items.error().message;
  ASSERT_EQ(items->size(), 5u);
  for (const DroppedItem& item : *items) {
    const bool is_captions = item.item_id == PairIdFromImageIds(3, 4);
    EXPECT_EQ(item.reason, is_captions ? DropReason::kWatermark : DropReason::kFewMatches) << item.item_id;
  }
}

TEST_F(MatchFeaturesTest, PairListChoosesThePairs) {
  WriteFeatures(4);
  inputs_.pair_list_path = folder_ + "/pairs.txt";
  std::ofstream(inputs_.pair_list_path) << "# left right\nimage0.png image2.png\n\nimage2.png  image0.png\n"
                                           "image3.png image1.png\r\n";
  const auto summary = Match(true);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->pairs, "list");
  EXPECT_EQ(summary->num_pairs_tried, 2);
  EXPECT_EQ(summary->num_pairs_verified, 2);
}

TEST_F(MatchFeaturesTest, BadLineOfAPairListIsNamed) {
  WriteFeatures(3, [](SQLite::Database& database) {
    database.exec("DELETE FROM keypoints WHERE image_id = 3; DELETE FROM descriptors WHERE image_id = 3");
  });
  inputs_.pair_list_path = folder_ + "/pairs.txt";
  const auto message_of = [&](const std::string& text) {
    std::ofstream(inputs_.pair_list_path) << text;
    const auto summary = Match(true);
    return summary.ok() ? "" : summary.error().message;
  };
  EXPECT_THAT(
      message_of("image0.png image1.png\nimage0.png imag1.png\n"),
      HasSubstr("pairs.txt, line 2: the database has no image 'imag1.png'; did you mean 'image1.png'?"));
  EXPECT_THAT(message_of("image0.png\n"), HasSubstr("line 1: 1 word(s), expected the names of two images"));
  EXPECT_THAT(message_of("image0.png image0.png\n"), HasSubstr("'image0.png' is paired with itself"));
  EXPECT_THAT(message_of("image0.png image2.png\n"), HasSubstr("no pair of images with features (1 pair(s)"));
  EXPECT_THAT(message_of(""), HasSubstr("names no pair"));
  fs::remove(inputs_.pair_list_path);
  EXPECT_EQ(Match(true).error().code, ErrorCode::kNotFound);
}

TEST_F(MatchFeaturesTest, OneImageIsAnErrorAndLeavesNoFile) {
  WriteFeatures(1);
  const auto summary = Match(true);
  ASSERT_FALSE(summary.ok());
  EXPECT_EQ(summary.error().code, ErrorCode::kNoData);
  EXPECT_THAT(summary.error().message, HasSubstr("1 image(s) with features, at least 2"));
  EXPECT_FALSE(fs::exists(folder_ + "/matches.db"));
}

TEST_F(MatchFeaturesTest, NoOverlapIsAnErrorThatSaysSo) {
  WriteFeatures(2);
  capture_.images[1].cam_from_world->rotation = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY());
  const auto summary = Match(true);
  ASSERT_FALSE(summary.ok());
  EXPECT_THAT(summary.error().message, HasSubstr("do the images overlap"));
  EXPECT_FALSE(fs::exists(folder_ + "/matches.db"));
}

TEST_F(MatchFeaturesTest, DescriptorBlobOfWrongLengthNamesTheRow) {
  WriteFeatures(2, [](SQLite::Database& database) {
    database.exec("UPDATE descriptors SET data = x'0102' WHERE image_id = 2");
  });
  const auto summary = Match(true);
  EXPECT_EQ(summary.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(summary.error().message,
              HasSubstr("table descriptors, row 2: blob of 2 bytes, expected 80 x 128"));
}

TEST_F(MatchFeaturesTest, ASecondRowOfAnImageIsAnError) {
  WriteFeatures(3, [](SQLite::Database& database) {
    for (const char* table : {"keypoints", "descriptors"}) {
      database.exec(fmt::format(
          "CREATE TABLE plain (image_id, rows, cols, data, PRIMARY KEY (image_id, rows)) WITHOUT ROWID; "
          "INSERT "
          "INTO plain SELECT * FROM {0}; DROP TABLE {0}; ALTER TABLE plain RENAME TO {0}; INSERT INTO {0} "
          "SELECT image_id, 1, cols, substr(data, 1, length(data) / rows) FROM {0} WHERE rows > 1",
          table));
    }
  });
  for (const char* pairs : {"retrieval", "exhaustive"}) {
    options_.pairs = pairs;
    const auto summary = Match(true);
    ASSERT_FALSE(summary.ok()) << pairs;
    EXPECT_EQ(summary.error().code, ErrorCode::kCorrupt) << summary.error().message;
    EXPECT_THAT(summary.error().message, HasSubstr("80")) << pairs;
  }
}

TEST_F(MatchFeaturesTest, TruncatedDatabaseIsAnError) {
  WriteFeatures(3);
  const std::string bytes = *ReadFile(folder_ + "/features.db");
  std::ofstream(folder_ + "/features.db", std::ios::binary) << bytes.substr(0, 6000);
  EXPECT_EQ(Match(true).error().code, ErrorCode::kCorrupt);
  std::ofstream(folder_ + "/features.db", std::ios::binary);
  EXPECT_EQ(Match(true).error().code, ErrorCode::kCorrupt);
}

TEST_F(MatchFeaturesTest, ColmapMapperReconstructsFromOurMatches) {
  WriteFeatures(6);
  ASSERT_TRUE(Match(false).ok());
  fs::copy_file(folder_ + "/matches.db", folder_ + "/copy.db");
  fs::create_directories(folder_ + "/model");
  fs::create_directories(folder_ + "/images");
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap mapper --Mapper.init_min_tri_angle 4 --image_path " + folder_ +
      "/images --database_path " + folder_ + "/copy.db --output_path " + folder_ + "/model > " + folder_ +
      "/colmap.log 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << *ReadFile(folder_ + "/colmap.log");
  EXPECT_TRUE(fs::exists(folder_ + "/model/0/images.bin")) << *ReadFile(folder_ + "/colmap.log");
}

}  // namespace
}  // namespace cairn::match_features
