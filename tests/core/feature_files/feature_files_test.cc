#include "core/feature_files/feature_files.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/colmap/colmap_database.h"
#include "core/feature_files/npz_file.h"
#include "core/features/descriptor_kind_table.h"
#include "core/features/features.h"
#include "core/files/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class FeatureFilesTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "/feature_files_" +
              testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }

  void Write(const std::string& name, const std::string& bytes) const {
    const fs::path path = fs::path(folder_) / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << bytes;
  }

  // What NumPy writes.
  void Python(const std::string& script) const {
    Write("write.py", "import numpy as np, os\nos.chdir('" + folder_ + "')\n" + script);
    ASSERT_EQ(std::system(("/usr/bin/python3 " + folder_ + "/write.py").c_str()), 0) << script;
  }

  std::string Failure(const std::string& path, const std::string& descriptors = "auto",
                      const std::string& name = "a.jpg") const {
    const Result<FeatureFiles> files = FeatureFiles::Open(path, descriptors);
    if (!files.ok()) return files.error().message;
    const auto found = files->Find(name);
    return found.ok() ? (*found ? "found" : "none") : found.error().message;
  }

  std::string folder_;
};

std::string Floats(const std::vector<float>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)};
}

TEST_F(FeatureFilesTest, NumPysFilesAreReadInEveryFormThatItWrites) {
  Python(R"(
k = np.array([[1.5, 2.5], [100, 50.25], [7, 8]])
d = np.arange(3 * 64).reshape(3, 64) - 90.0
os.makedirs('plain/sub')
np.savez('plain/a.npz', keypoints=k, descriptors=d)
np.savez_compressed('plain/sub/b.jpg.npz', keypoints=k.astype('f4'), descriptors=d.astype('f4'))
np.savez('plain/half.npz', keypoints=k.astype('f2'), descriptors=d.astype('f2'))
np.savez('plain/hloc.npz', keypoints=k.astype('f2'), descriptors=d.T.astype('f4'), scores=np.ones(3))
np.savez('plain/columns.npz', keypoints=np.asfortranarray(k), descriptors=np.asfortranarray(d))
np.savez('plain/none.npz', keypoints=np.zeros((0, 2)), descriptors=np.zeros((0, 64)))
)");
  const FeatureFiles files = *FeatureFiles::Open(folder_ + "/plain", "float net");
  EXPECT_EQ(files.layout(), "folder of .npz files");
  EXPECT_EQ(ToString(files.kind()), "float 64 net");
  const Features first = **files.Find("a.jpg");
  ASSERT_EQ(first.keypoints.size(), 3u);
  EXPECT_EQ(first.keypoints[1].x, 100.5F) << "NumPy's pixels are centred at whole numbers";
  EXPECT_EQ(first.keypoints[1].y, 50.75F);
  EXPECT_EQ(first.keypoints[1].scale, 0);
  EXPECT_EQ(first.kind, files.kind());
  FloatDescriptors expected(3, 64);
  for (int i = 0; i < 3 * 64; ++i) expected.data()[i] = static_cast<float>(i) - 90;
  EXPECT_EQ(first.descriptors, *DescriptorsFromFloats(expected, files.kind()));
  for (const char* name : {"sub/b.jpg", "half.png", "hloc.jpg", "columns.jpg"}) {
    const auto same = files.Find(name);
    ASSERT_TRUE(same.ok() && same->has_value()) << name;
    EXPECT_EQ((*same)->descriptors, first.descriptors) << name;
    EXPECT_EQ((*same)->keypoints[2].x, 7.5F) << name;
  }
  EXPECT_EQ((*files.Find("none.jpg"))->descriptors.rows(), 0);
  EXPECT_FALSE(files.Find("c.jpg")->has_value());
  EXPECT_FALSE(files.Find("../plain/a.jpg")->has_value()) << "a name leads nowhere but below the folder";
}

// hloc's descriptors are columns; 64 keypoints of 64 values do not say so.
TEST_F(FeatureFilesTest, SquareArraysAreAsTheOthers) {
  Python(R"(
d = np.arange(64 * 64.0).reshape(64, 64) - 2000
for name, turn in dict(rows=lambda d: d, columns=lambda d: d.T).items():
  os.makedirs(name)
  np.savez(name + '/a.npz', keypoints=np.zeros((64, 2)), descriptors=turn(d))
  np.savez(name + '/b.npz', keypoints=np.zeros((5, 2)), descriptors=turn(d[:5]))
)");
  const Features rows = **FeatureFiles::Open(folder_ + "/rows")->Find("a.jpg");
  const Features columns = **FeatureFiles::Open(folder_ + "/columns")->Find("a.jpg");
  EXPECT_EQ(rows.descriptors, columns.descriptors);
  EXPECT_EQ(rows.descriptors.row(3),
            (*FeatureFiles::Open(folder_ + "/columns")->Find("b.jpg"))->descriptors.row(3));
}

TEST_F(FeatureFilesTest, WhatNumPyWritesAndNobodyCanUseIsNamed) {
  Python(R"(
k, d = np.zeros((2, 2)), np.ones((2, 64))
for name, values in {
    'integers': dict(keypoints=k, descriptors=np.ones((2, 64), 'i4')), 'big': dict(keypoints=k, descriptors=d.astype('>f4')),
    'cube': dict(keypoints=k, descriptors=np.ones((2, 8, 8))), 'short': dict(keypoints=k, descriptors=np.ones((3, 64))),
    'columns': dict(keypoints=np.zeros((2, 5)), descriptors=d), 'other': dict(points=k, descriptors=d),
    'nan': dict(keypoints=k, descriptors=np.full((2, 64), np.nan)), 'far': dict(keypoints=np.full((2, 2), np.inf), descriptors=d),
    'few': dict(keypoints=k, descriptors=np.ones((2, 31))), 'many': dict(keypoints=k, descriptors=np.ones((2, 1025)))}.items():
  os.makedirs(name)
  np.savez(name + '/a.npz', **values)
)");
  const std::pair<const char*, const char*> expected[] = {
      {"integers", "descriptors.npy: numbers of type '<i4' in 2 dimensions"},
      {"big", "numbers of type '>f4'"},
      {"cube", "in 3 dimensions"},
      {"short", "2 keypoints and 3 descriptors"},
      {"columns", "keypoints of 5 numbers"},
      {"other", "a.npz: no array 'keypoints'"},
      {"nan", "descriptor 0 has a value that is not finite"},
      {"far", "keypoint 0 has a number that is not finite"},
      {"few", "31 floating-point numbers a descriptor; descriptors of 32 to 1024"},
      {"many", "1025 floating-point numbers a descriptor"}};
  for (const auto& [name, text] : expected) {
    EXPECT_THAT(Failure(folder_ + "/" + name), HasSubstr(text)) << name;
    EXPECT_THAT(Failure(folder_ + "/" + name), HasSubstr(std::string(name) + "/a.npz")) << name;
  }
}

TEST_F(FeatureFilesTest, DamagedNpzFilesAreErrorsOrTheSame) {
  Python(R"(
np.savez_compressed('a.npz', keypoints=np.arange(8.0).reshape(4, 2), descriptors=np.arange(256.0).reshape(4, 64))
)");
  const std::string path = folder_ + "/a.npz";
  const std::string bytes = *ReadFile(path);
  const std::string whole = (*ReadNpzArray(path, "descriptors"))->bytes;
  ASSERT_EQ(whole.size(), 256 * sizeof(double));
  for (size_t size = 0; size < bytes.size(); size += 7) {
    std::ofstream(path, std::ios::binary) << bytes.substr(0, size);
    EXPECT_FALSE(ReadNpzArray(path, "descriptors").ok()) << size;
  }
  int num_errors = 0;
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::string changed = bytes;
    changed[i] = static_cast<char>(changed[i] ^ 0x41);
    std::ofstream(path, std::ios::binary) << changed;
    const auto array = ReadNpzArray(path, "descriptors");
    num_errors += array.ok() ? 0 : 1;
    if (array.ok() && *array) {
      EXPECT_EQ((*array)->bytes, whole) << i;  // the archive has a sum of the bytes
    }
  }
  EXPECT_GT(num_errors, 100);
  EXPECT_EQ(ReadNpzArray(folder_ + "/none.npz", "a").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadNpzArray(folder_, "a").error().code, ErrorCode::kNotFound);
}

TEST_F(FeatureFilesTest, BytesAreBitsOrSiftUnlessSomebodySaysOtherwise) {
  Python(R"(
k = np.array([[1, 2, 3, 0.5]])
for name, width in dict(orb=32, akaze=61, sift=128, long=256).items():
  os.makedirs(name)
  np.savez(name + '/a.npz', keypoints=k, descriptors=np.full((1, width), 5, 'u1'))
)");
  EXPECT_EQ(ToString(FeatureFiles::Open(folder_ + "/orb")->kind()), "binary 256");
  EXPECT_EQ(ToString(FeatureFiles::Open(folder_ + "/akaze", "auto akaze")->kind()), "binary 488 akaze");
  EXPECT_EQ(ToString(FeatureFiles::Open(folder_ + "/sift")->kind()), "sift");
  EXPECT_EQ(ToString(FeatureFiles::Open(folder_ + "/sift", "binary")->kind()), "binary 1024");
  EXPECT_EQ(ToString(FeatureFiles::Open(folder_ + "/long", "dense")->kind()), "dense 256");
  EXPECT_THAT(Failure(folder_ + "/long"),
              HasSubstr("256 bytes a descriptor may be numbers or bits; say which"));
  EXPECT_THAT(Failure(folder_ + "/orb", "sift"), HasSubstr("32 bytes a descriptor; SIFT's are 128 bytes"));
  EXPECT_THAT(Failure(folder_ + "/orb", "bits"), HasSubstr("descriptors 'bits'; expected auto, sift,"));
  EXPECT_THAT(Failure(folder_ + "/orb", "binary or b"), HasSubstr("expected auto, sift,"));
  const FeatureFiles sift = *FeatureFiles::Open(folder_ + "/sift");
  const Features features = **sift.Find("a.png");
  EXPECT_TRUE((features.descriptors.array() == 5).all());
  EXPECT_EQ(features.keypoints[0].scale, 3);
  EXPECT_EQ(features.keypoints[0].orientation, 0.5F);
  const FeatureFiles orb = *FeatureFiles::Open(folder_ + "/orb");
  EXPECT_EQ(BitsOfDescriptors((*orb.Find("a.png"))->descriptors), std::string(32, '\5'));
}

TEST_F(FeatureFilesTest, KaptureOfBothVersionsIsRead) {
  std::string bits(2 * 32, '\1');
  for (const std::string root : {"new", "old"}) {
    const std::string type = root == "new" ? "/orb" : "";
    const std::string keypoints = root + "/reconstruction/keypoints" + type;
    const std::string descriptors = root + "/reconstruction/descriptors" + type;
    Write(keypoints + "/keypoints.txt", "# kapture format: 1.1\n# name, dtype, dsize\nORB, float32, 6\n");
    Write(descriptors + "/descriptors.txt", "# a comment\n\nORB, uint8, 32, orb, hamming\n");
    Write(keypoints + "/cam/a.jpg.kpt", Floats({1, 2, 3, 0, 0, 3, 10, 20, 0, -4, 4, 0}));
    Write(descriptors + "/cam/a.jpg.desc", bits);
    const FeatureFiles files = *FeatureFiles::Open(folder_ + "/" + root);
    EXPECT_EQ(files.layout(), "kapture folder");
    EXPECT_EQ(ToString(files.kind()), "binary 256 ORB") << "it says what made them";
    const Features features = **files.Find("cam/a.jpg");
    ASSERT_EQ(features.keypoints.size(), 2u);
    EXPECT_EQ(features.keypoints[0].x, 1) << "COLMAP's pixels";
    EXPECT_EQ(features.keypoints[0].scale, 3);
    EXPECT_EQ(features.keypoints[1].scale, 4);
    EXPECT_NEAR(features.keypoints[1].orientation, std::numbers::pi / 2, 1e-6);
    EXPECT_EQ(BitsOfDescriptors(features.descriptors), bits);
    EXPECT_FALSE(files.Find("cam/b.jpg")->has_value());
  }
  // Several types: the user names one.
  Write("new/reconstruction/descriptors/r2d2/descriptors.txt", "r2d2, float32, 128, orb, L2\n");
  EXPECT_THAT(Failure(folder_ + "/new"), HasSubstr("descriptors of 2 types; name the folder of one: "));
  EXPECT_EQ(ToString(FeatureFiles::Open(folder_ + "/new/reconstruction/descriptors/r2d2", "dense")->kind()),
            "dense 128 r2d2");
  Write("new/reconstruction/descriptors/orb/cam/a.jpg.desc", bits + "x");
  EXPECT_THAT(Failure(folder_ + "/new/reconstruction/descriptors/orb", "auto", "cam/a.jpg"),
              HasSubstr("a.jpg.desc: 65 bytes, not whole rows of 32"));
  Write("new/reconstruction/descriptors/orb/cam/a.jpg.desc", bits + bits);
  EXPECT_THAT(Failure(folder_ + "/new/reconstruction/descriptors/orb", "auto", "cam/a.jpg"),
              HasSubstr("2 keypoints and 4 descriptors"));
  Write("new/reconstruction/descriptors/orb/descriptors.tar", "");
  EXPECT_THAT(Failure(folder_ + "/new/reconstruction/descriptors/orb", "auto", "cam/c.jpg"),
              HasSubstr("descriptors.tar: archives are not read; unpack it there: tar -xf descriptors.tar"));
  Write("new/reconstruction/descriptors/orb/descriptors.txt", "ORB, int64, 32\n");
  EXPECT_THAT(Failure(folder_ + "/new/reconstruction/descriptors/orb"),
              HasSubstr("descriptors.txt: 'ORB, int64, 32'"));
  Write("new/reconstruction/descriptors/orb/descriptors.txt", "# nothing\n");
  EXPECT_THAT(Failure(folder_ + "/new/reconstruction/descriptors/orb"),
              HasSubstr("no line says what the numbers are"));
}

// As pycolmap writes what another program found: bytes of any width, which COLMAP 4.0 says the type of.
TEST_F(FeatureFilesTest, ColmapDatabasesOfAnyDescriptorsAreRead) {
  const auto write = [&](const std::string& name, int width, const std::string& data, int type) {
    const std::string path = folder_ + "/" + name + ".db";
    ASSERT_TRUE(WriteDatabase(path, kColmapSchema, [&](SQLite::Database& database) -> Status {
                  if (type >= 0)
                    database.exec("ALTER TABLE descriptors ADD COLUMN type INTEGER NOT NULL DEFAULT 0");
                  database.exec("INSERT INTO cameras VALUES (1, 0, 640, 480, zeroblob(24), 1)");
                  WriteDatabaseImage(database, {1, "a.jpg", 1});
                  SQLite::Statement keypoints(database, "INSERT INTO keypoints VALUES (1, 2, 2, ?)");
                  const std::string points = Floats({0.5, 1, 20, 30});
                  keypoints.bind(1, points.data(), static_cast<int>(points.size()));
                  keypoints.exec();
                  SQLite::Statement row(database, type >= 0 ? "INSERT INTO descriptors VALUES (1, 2, ?, ?, ?)"
                                                            : "INSERT INTO descriptors VALUES (1, 2, ?, ?)");
                  row.bind(1, width);
                  row.bind(2, data.data(), static_cast<int>(data.size()));
                  if (type >= 0) row.bind(3, type);
                  row.exec();
                  return Ok();
                }).ok());
  };
  std::vector<float> values(2 * 128);
  for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i % 7) - 3;
  write("aliked", 4 * 128, Floats(values), 1);
  write("older", 4 * 128, Floats(values), -1);
  write("small", 4 * 32, Floats(std::vector<float>(values.begin(), values.begin() + 64)), 1);
  write("orb", 32, std::string(64, '\3'), -1);
  write("sift", 128, std::string(256, '\3'), 0);
  write("odd", 257, std::string(2 * 257, '\3'), -1);
  for (const char* name : {"aliked", "older"}) {
    const FeatureFiles files = *FeatureFiles::Open(folder_ + "/" + name + ".db", "auto aliked");
    EXPECT_EQ(files.layout(), "COLMAP database");
    EXPECT_EQ(ToString(files.kind()), "float 128 aliked");
    const Features features = **files.Find("a.jpg");
    EXPECT_EQ(
        features.descriptors,
        *DescriptorsFromFloats(Eigen::Map<const FloatDescriptors>(values.data(), 2, 128), files.kind()));
    EXPECT_EQ(features.keypoints[0].x, 0.5F);
    EXPECT_EQ(features.keypoints[0].scale, 0) << "places alone";
  }
  EXPECT_EQ(ToString(FeatureFiles::Open(folder_ + "/small.db")->kind()), "float 32")
      << "its type is not SIFT's";
  const FeatureFiles orb = *FeatureFiles::Open(folder_ + "/orb.db");
  EXPECT_EQ(ToString(orb.kind()), "binary 256");
  EXPECT_EQ(BitsOfDescriptors((*orb.Find("a.jpg"))->descriptors), std::string(64, '\3'));
  EXPECT_FALSE(orb.Find("b.jpg")->has_value());
  const FeatureFiles sift = *FeatureFiles::Open(folder_ + "/sift.db");
  EXPECT_TRUE(sift.kind().is_sift());
  EXPECT_TRUE(((*sift.Find("a.jpg"))->descriptors.array() == 3).all());
  EXPECT_THAT(Failure(folder_ + "/odd.db"), HasSubstr("257 bytes a descriptor may be numbers or bits"));
  EXPECT_THAT(Failure(folder_ + "/odd.db", "float"),
              HasSubstr("257 bytes a descriptor are no numbers of 4 bytes"));
}

TEST_F(FeatureFilesTest, ACapturesOwnFeaturesAreTakenAsTheyAre) {
  const DescriptorKind kind{DescriptorType::kFloat, 64, "net"};
  Features features{
      .keypoints = {{3, 4, 0, 0}}, .descriptors = DescriptorMatrix::Constant(1, 64, 131), .kind = kind};
  fs::create_directories(folder_ + "/capture");
  ASSERT_TRUE(WriteDatabase(folder_ + "/capture/features.db", kColmapSchema,
                            [&](SQLite::Database& database) -> Status {
                              StateDescriptorKind(database, kind);
                              database.exec("INSERT INTO cameras VALUES (1, 0, 640, 480, zeroblob(24), 1)");
                              WriteDatabaseImage(database, {1, "a.jpg", 1});
                              WriteDatabaseFeatures(database, 1, features);
                              return Ok();
                            })
                  .ok());
  const FeatureFiles files = *FeatureFiles::Open(folder_ + "/capture");
  EXPECT_EQ(files.kind(), kind);
  const Features found = **files.Find("a.jpg");
  EXPECT_EQ(found.descriptors, features.descriptors);
  EXPECT_EQ(found.keypoints[0].scale, 0);
}

TEST_F(FeatureFilesTest, WhatHasNoFeaturesSaysWhatWasExpected) {
  EXPECT_THAT(Failure(folder_ + "/none"), HasSubstr("no such file or folder; expected a COLMAP database,"));
  EXPECT_THAT(Failure(folder_), HasSubstr("no .npz file and no reconstruction/keypoints in it"));
  Write("text.db", "not a database");
  EXPECT_THAT(Failure(folder_ + "/text.db"), HasSubstr("text.db"));
}

}  // namespace
}  // namespace cairn
