// Blocks put together by hand, with numbers at the limits of what they may be and beyond.
#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_blocks.h"
#include "core/packing/map_codes.h"
#include "tests/core/blocks/page_bytes.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

struct HandImage {
  uint64_t step = 1, shared = 0;
  std::string rest = "a";
  uint64_t camera_id = 3, station = 0;
  std::array<int64_t, 3> place = {};
  std::string landmarks = NoRuns();

  std::string Bytes() const {
    const std::string rotation = U8(0) + U32(0) + U32(0) + U32(0);
    return V(step) + V(shared) + V(rest.size()) + rest + V(camera_id) + V(station) + rotation +
           U32(place[0]) + U32(place[1]) + U32(place[2]) + landmarks;
  }
};

Result<ImageBlock> DecodeImages(const std::vector<HandImage>& images, const std::string& more = "",
                                uint32_t num_landmarks = 10) {
  const auto num = static_cast<uint32_t>(images.size());
  const MapDirectory directory = DirectoryOf(
      {{BlockKind::kStations, 5}, {BlockKind::kLandmarks, num_landmarks}, {BlockKind::kImages, num}});
  std::string bytes;
  for (const HandImage& image : images) bytes += image.Bytes();
  return DecodeImageBlock(bytes + more, EntryOf(BlockKind::kImages, 7, num), directory, "block");
}

std::string ImageRefusal(const HandImage& image) { return RefusalOf(DecodeImages({{}, image})); }

TEST(ImageBlockLimits, BytesAreReadAsThePageDrawsThem) {
  const Result<ImageBlock> block = DecodeImages({{.step = 1, .rest = "room1.png"},
                                                 {.step = 4,
                                                  .shared = 4,
                                                  .rest = "2",
                                                  .camera_id = 9,
                                                  .station = 5,
                                                  .place = {10000, -1, 20},
                                                  .landmarks = RunOf(4, 3)}});
  ASSERT_TRUE(block.ok()) << block.error().message;
  EXPECT_EQ(block->first, 7);
  EXPECT_EQ(block->images[0].image_id, 0u);
  EXPECT_EQ(block->images[0].station, -1);
  EXPECT_EQ(block->images[1].image_id, 4u);
  EXPECT_EQ(block->images[1].name, "room2");
  EXPECT_EQ(block->images[1].camera_id, 9u);
  EXPECT_EQ(block->images[1].station, 4);
  EXPECT_EQ(block->images[1].cam_from_world.translation, Eigen::Vector3d(1, -1 * 1e-4, 20 * 1e-4));
  EXPECT_THAT(block->images[1].landmarks, ElementsAre(4, 5, 6));
  // As they were written.
  EXPECT_EQ(EncodeBlock(*block),
            HandImage({.step = 1, .rest = "room1.png"}).Bytes() + HandImage({.step = 4,
                                                                             .shared = 4,
                                                                             .rest = "2",
                                                                             .camera_id = 9,
                                                                             .station = 5,
                                                                             .place = {10000, -1, 20},
                                                                             .landmarks = RunOf(4, 3)})
                                                                      .Bytes());
}

TEST(ImageBlockLimits, IdsAreAscendingAndBelowTheInvalidOne) {
  EXPECT_EQ(ImageRefusal({.step = 1}), "");
  EXPECT_THAT(ImageRefusal({.step = 0}), HasSubstr("the id and what follows of image 1 of 2 make no sense"));
  EXPECT_EQ(RefusalOf(DecodeImages({{.step = kInvalidImageId}})), "");
  EXPECT_THAT(RefusalOf(DecodeImages({{.step = uint64_t{kInvalidImageId} + 1}})), HasSubstr("the id"));
  EXPECT_EQ(ImageRefusal({.step = kInvalidImageId - 1}), "");
  EXPECT_THAT(ImageRefusal({.step = kInvalidImageId}), HasSubstr("the id"));
  EXPECT_THAT(ImageRefusal({.step = std::numeric_limits<uint64_t>::max()}), HasSubstr("the id"));
}

TEST(ImageBlockLimits, NamesShareWhatThereIsAndAreOf4096Bytes) {
  EXPECT_EQ(ImageRefusal({.shared = 1, .rest = ""}), "");
  EXPECT_THAT(ImageRefusal({.shared = 2, .rest = "b"}), HasSubstr("the name and what follows of image 1"));
  EXPECT_THAT(RefusalOf(DecodeImages({{.shared = 1}})), HasSubstr("the name"));
  const std::string most(4096, 'a');
  EXPECT_EQ(RefusalOf(DecodeImages({{.rest = most}, {.shared = 4095, .rest = "b"}})), "");
  EXPECT_THAT(RefusalOf(DecodeImages({{.rest = most}, {.shared = 4096, .rest = "b"}})),
              HasSubstr("the name"));
  EXPECT_THAT(RefusalOf(DecodeImages({{.rest = most + 'a'}})), HasSubstr("the name"));
}

TEST(ImageBlockLimits, CamerasStationsAndPlacesAreInRange) {
  EXPECT_EQ(ImageRefusal({.camera_id = 0xffffffff}), "");
  EXPECT_THAT(ImageRefusal({.camera_id = 0x100000000}), HasSubstr("the camera and the station of image 1"));
  EXPECT_EQ(ImageRefusal({.station = 5}), "");
  EXPECT_THAT(ImageRefusal({.station = 6}), HasSubstr("the camera and the station"));
  for (const int axis : {0, 2}) {
    for (const int64_t sign : {1, -1}) {
      HandImage image;
      image.place[axis] = sign * 2'000'000'000;
      EXPECT_EQ(ImageRefusal(image), "");
      image.place[axis] += sign;
      EXPECT_THAT(ImageRefusal(image), HasSubstr("the coordinates of image 1"));
    }
  }
}

TEST(ImageBlockLimits, AnImageSees262144LandmarksAndABlockSixteenTimesThat) {
  const uint32_t most = 1 << 18;
  EXPECT_EQ(RefusalOf(DecodeImages({{.landmarks = RunOf(0, most)}}, "", 2 * most)), "");
  EXPECT_THAT(RefusalOf(DecodeImages({{.landmarks = RunOf(0, most + 1)}}, "", 2 * most)),
              HasSubstr("the pose and the landmarks of image 0 of 1"));
  std::vector<HandImage> images(17, {.landmarks = RunOf(0, most)});
  images[16].landmarks = NoRuns();
  EXPECT_EQ(RefusalOf(DecodeImages(images, "", most)), "");
  images[16].landmarks = RunOf(1);
  EXPECT_THAT(RefusalOf(DecodeImages(images, "", most)), HasSubstr("of image 16 of 17"));
  EXPECT_THAT(ImageRefusal({.landmarks = RunOf(10)}), HasSubstr("the pose and the landmarks"));
  EXPECT_THAT(RefusalOf(DecodeImages({{}, {}}, "x")), HasSubstr("bytes are left after 2 images"));
}

Result<StationBlock> DecodeStations(const std::string& second, uint32_t num_stations = 12) {
  const MapDirectory directory =
      DirectoryOf({{BlockKind::kStations, num_stations}, {BlockKind::kRegions, 4}});
  return DecodeStationBlock(Z(0) + Z(0) + U8(0) + NoRuns() + NoRuns() + second,
                            EntryOf(BlockKind::kStations, 7, 2), directory, "block");
}

TEST(StationBlockLimits, BytesAreReadAsThePageDrawsThem) {
  const std::string bytes = Z(12345) + Z(-1) + U8(3) + Z(-90500) + RunOf(9) + RunOf(0, 2);
  const Result<StationBlock> block = DecodeStations(bytes);
  ASSERT_TRUE(block.ok()) << block.error().message;
  EXPECT_EQ(block->first, 7);
  EXPECT_LT((block->stations[1].position - Eigen::Vector2d(1.2345, -1e-4)).norm(), 1e-12);
  EXPECT_TRUE(block->stations[1].is_covered);
  EXPECT_DOUBLE_EQ(*block->stations[1].heading_deg, -90.5);
  EXPECT_THAT(block->neighbours, ElementsAre(IsEmpty(), ElementsAre(9)));
  EXPECT_THAT(block->regions, ElementsAre(IsEmpty(), ElementsAre(0, 1)));
  EXPECT_FALSE(block->stations[0].is_covered);
  EXPECT_FALSE(block->stations[0].heading_deg);
  EXPECT_EQ(EncodeBlock(*block), Z(0) + Z(0) + U8(0) + NoRuns() + NoRuns() + bytes);
  EXPECT_TRUE(DecodeStations(Z(0) + Z(0) + U8(1) + NoRuns() + NoRuns())->stations[1].is_covered);
  EXPECT_FALSE(DecodeStations(Z(0) + Z(0) + U8(2) + Z(5) + NoRuns() + NoRuns())->stations[1].is_covered);
}

TEST(StationBlockLimits, NumbersAreInRange) {
  const auto refusal = [](int64_t x, int64_t y, int64_t heading, const std::string& neighbours,
                          const std::string& regions) {
    return RefusalOf(DecodeStations(Z(x) + Z(y) + U8(2) + Z(heading) + neighbours + regions));
  };
  for (const int64_t sign : {1, -1}) {
    const int64_t most = sign * 2'000'000'000;
    EXPECT_EQ(refusal(most, most, 0, NoRuns(), NoRuns()), "");
    EXPECT_THAT(refusal(most + sign, 0, 0, NoRuns(), NoRuns()), HasSubstr("station 8 lies more than 200 km"));
    EXPECT_THAT(refusal(0, most + sign, 0, NoRuns(), NoRuns()), HasSubstr("station 8 lies more than 200 km"));
    EXPECT_EQ(refusal(0, 0, sign * 1'000'000'000, NoRuns(), NoRuns()), "");
    EXPECT_THAT(refusal(0, 0, sign * 1'000'000'001, NoRuns(), NoRuns()),
                HasSubstr("station 8: its heading is not valid"));
  }
  EXPECT_EQ(refusal(0, 0, 0, RunOf(11), RunOf(3)), "");
  EXPECT_THAT(refusal(0, 0, 0, RunOf(12), NoRuns()), HasSubstr("the neighbours or regions of station 8"));
  EXPECT_THAT(refusal(0, 0, 0, NoRuns(), RunOf(4)), HasSubstr("the neighbours or regions of station 8"));
  EXPECT_EQ(refusal(0, 0, 0, RunOf(9), NoRuns()), "");
  EXPECT_THAT(refusal(0, 0, 0, RunOf(8), NoRuns()),
              HasSubstr("station 8 has a neighbour that is not larger"));
  EXPECT_THAT(RefusalOf(DecodeStations(Z(0) + Z(0) + U8(4) + NoRuns() + NoRuns())),
              HasSubstr("of station 8"));
  EXPECT_THAT(refusal(0, 0, 0, NoRuns(), NoRuns() + 'x'), HasSubstr("bytes are left after 2 stations"));
}

TEST(RegionBlockLimits, BytesAreReadAsThePageDrawsThem) {
  const auto decode = [](const std::string& bytes) {
    const MapDirectory directory = DirectoryOf({{BlockKind::kLandmarks, 9}, {BlockKind::kRegions, 12}});
    return DecodeRegionBlock(bytes, EntryOf(BlockKind::kRegions, 7, 2), directory, "block");
  };
  const Result<RegionBlock> block = decode(NoRuns() + RunOf(0));
  ASSERT_TRUE(block.ok());
  EXPECT_EQ(block->first, 7);
  EXPECT_THAT(block->landmark_blocks, ElementsAre(IsEmpty(), ElementsAre(0)));
  EXPECT_EQ(EncodeBlock(*block), NoRuns() + RunOf(0));
  EXPECT_THAT(RefusalOf(decode(NoRuns() + RunOf(1))),
              HasSubstr("the landmark blocks of region 8 make no sense"));
  EXPECT_THAT(RefusalOf(decode(NoRuns() + NoRuns() + 'x')), HasSubstr("bytes are left after 2 regions"));
}

TEST(WordBlockLimits, PostingsAreOfImagesThatThereAre) {
  const auto decode = [](const std::string& bytes) {
    return DecodeWordBlock(bytes, EntryOf(BlockKind::kWords, 7, 2), DirectoryOf({{BlockKind::kImages, 6}}),
                           "block");
  };
  // Images 0 (once), 2 (four times), 5 (twice): steps less 1, doubled, and 1 more where it is more than once.
  const std::string bytes = V(0) + V(3) + V(0) + V(3) + V(2) + V(5) + V(0);
  const Result<WordBlock> block = decode(bytes);
  ASSERT_TRUE(block.ok());
  EXPECT_EQ(block->first, 7);
  EXPECT_THAT(block->Postings(0), IsEmpty());
  EXPECT_EQ(block->Postings(1), (std::vector<Posting>{{0, 1}, {2, 4}, {5, 2}}));
  EXPECT_EQ(EncodeBlock(PackWords(7, {{}, {{0, 1}, {2, 4}, {5, 2}}})), bytes);
  EXPECT_EQ(RefusalOf(decode(V(0) + V(1) + V(10))), "");
  EXPECT_THAT(RefusalOf(decode(V(0) + V(1) + V(12))),
              HasSubstr("word 8: its postings are not ascending images below 6"));
  EXPECT_THAT(RefusalOf(decode(V(0) + V(2) + V(10) + V(0))), HasSubstr("word 8"));
  EXPECT_THAT(RefusalOf(decode(V(0) + V(3) + V(0) + V(0))), HasSubstr("word 8"));
  EXPECT_THAT(RefusalOf(decode(V(0) + V(0) + 'x')), HasSubstr("bytes are left after 2 words"));
}

// A root with two leaves: 1 + 2 nodes, 2 centres of 32 values.
TEST(VocabularyTreeLimits, BytesAreReadAsThePageDrawsThem) {
  const auto decode = [](uint64_t branching, uint64_t depth, uint64_t children, uint32_t num_words,
                         const std::string& centres) {
    MapDirectory directory = DirectoryOf({{BlockKind::kWords, num_words}});
    directory.set_descriptor_kind({.type = DescriptorType::kFloat, .num_values = 32});
    return DecodeVocabularyTree(V(branching) + V(depth) + V(children) + V(0) + V(0) + centres,
                                EntryOf(BlockKind::kVocabularyTree, 0, 3), directory, "block");
  };
  const std::string centres = std::string(32, '\1') + std::string(32, '\2');
  const Result<Vocabulary> tree = decode(1000, 1000, 2, 2, centres);
  ASSERT_TRUE(tree.ok()) << tree.error().message;
  EXPECT_EQ(tree->branching, 1000);
  EXPECT_EQ(tree->depth, 1000);
  EXPECT_EQ(tree->nodes[0].num_children, 2);
  EXPECT_EQ(tree->centres(0, 5), 0);
  EXPECT_EQ(tree->centres(1, 31), 1);
  EXPECT_EQ(tree->centres(2, 0), 2);
  EXPECT_EQ(EncodeVocabularyTree(*tree), V(1000) + V(1000) + V(2) + V(0) + V(0) + centres);
  EXPECT_THAT(RefusalOf(decode(1001, 2, 2, 2, centres)), HasSubstr("a tree of 2 levels, 1001 branches"));
  EXPECT_THAT(RefusalOf(decode(2, 1001, 2, 2, centres)), HasSubstr("a tree of 1001 levels, 2 branches"));
  EXPECT_THAT(RefusalOf(decode(2, 1, 3, 2, centres)), HasSubstr("a vocabulary node with 3 children of 3"));
  EXPECT_THAT(RefusalOf(decode(2, 1, 2, 3, centres)), HasSubstr("2 leaves, but 3 words"));
  EXPECT_THAT(RefusalOf(decode(2, 1, 2, 2, centres + 'x')), HasSubstr("70 bytes do not fit 3 nodes"));
  EXPECT_THAT(RefusalOf(decode(2, 1, 2, 2, centres.substr(1))), HasSubstr("68 bytes do not fit 3 nodes"));
}

TEST(DocumentNormLimits, NormsAreNotNegativeAndFinite) {
  const auto decode = [](float second) {
    return DecodeDocumentNorms(F32(1.5F) + F32(second), EntryOf(BlockKind::kDocumentNorms, 0, 2), "block");
  };
  EXPECT_THAT(*decode(0), ElementsAre(1.5F, 0));
  EXPECT_EQ(EncodeDocumentNorms(*decode(2)), F32(1.5F) + F32(2));
  for (const float bad : {-1e-30F, std::numeric_limits<float>::infinity(), std::nanf("")})
    EXPECT_THAT(RefusalOf(decode(bad)), HasSubstr("a norm is not a valid number"));
  EXPECT_THAT(RefusalOf(DecodeDocumentNorms(F32(1), EntryOf(BlockKind::kDocumentNorms, 0, 2), "block")),
              HasSubstr("block"));
  EXPECT_THAT(RefusalOf(DecodeDocumentNorms(F32(1) + 'x', EntryOf(BlockKind::kDocumentNorms, 0, 1), "block")),
              HasSubstr("5 bytes are not 1 numbers"));
}

Result<AppearanceBlock> DecodeNodes(const std::string& second) {
  const MapDirectory directory = DirectoryOf({{BlockKind::kImages, 6}, {BlockKind::kAppearance, 12}});
  return DecodeAppearanceBlock(U8(1) + RunOf(0) + NoRuns() + second, EntryOf(BlockKind::kAppearance, 7, 2),
                               directory, "block");
}

TEST(AppearanceBlockLimits, BytesAreReadAsThePageDrawsThem) {
  const std::string bytes = U8(0) + RunOf(4, 2) + RunOf(9, 2) + V(31) + V(2147483647);
  const Result<AppearanceBlock> block = DecodeNodes(bytes);
  ASSERT_TRUE(block.ok()) << block.error().message;
  EXPECT_EQ(block->first, 7);
  EXPECT_EQ(block->nodes[0], (MapAppearanceNode{.images = {0}, .is_kept = true}));
  EXPECT_EQ(block->nodes[1], (MapAppearanceNode{.images = {4, 5}, .links = {{9, 31}, {10, 2147483647}}}));
  EXPECT_EQ(EncodeBlock(*block), U8(1) + RunOf(0) + NoRuns() + bytes);
}

TEST(AppearanceBlockLimits, NumbersAreInRange) {
  const auto refusal = [](uint8_t flags, const std::string& images, const std::string& links) {
    return RefusalOf(DecodeNodes(U8(flags) + images + links));
  };
  EXPECT_THAT(refusal(2, RunOf(1), NoRuns()), HasSubstr("the images or links of node 8 make no sense"));
  EXPECT_EQ(refusal(1, RunOf(5), NoRuns()), "");
  EXPECT_THAT(refusal(1, RunOf(6), NoRuns()), HasSubstr("of node 8"));
  EXPECT_THAT(refusal(1, NoRuns(), NoRuns()), HasSubstr("of node 8"));
  EXPECT_EQ(refusal(1, RunOf(1), RunOf(11) + V(1)), "");
  EXPECT_THAT(refusal(1, RunOf(1), RunOf(12) + V(1)), HasSubstr("of node 8"));
  EXPECT_EQ(refusal(1, RunOf(1), RunOf(9) + V(1)), "");
  EXPECT_THAT(refusal(1, RunOf(1), RunOf(8) + V(1)), HasSubstr("node 8 is linked to one that is not larger"));
  EXPECT_THAT(refusal(1, RunOf(1), RunOf(9) + V(0)), HasSubstr("a link of node 8 has 0 inliers"));
  EXPECT_THAT(refusal(1, RunOf(1), RunOf(9) + V(2147483648)),
              HasSubstr("a link of node 8 has 2147483648 inliers"));
  EXPECT_THAT(refusal(1, RunOf(1), NoRuns() + 'x'), HasSubstr("bytes are left after 2 nodes"));
}

TEST(AmbiguityBlockLimits, BytesAreReadAsThePageDrawsThemInThousandths) {
  const auto decode = [](const std::string& second, uint32_t num_nodes = 12) {
    return DecodeAmbiguityBlock(V(0) + NoRuns() + second, EntryOf(BlockKind::kAmbiguity, 7, 2),
                                DirectoryOf({{BlockKind::kAppearance, num_nodes}}), "block");
  };
  const std::string bytes = V(693) + RunOf(9, 2) + V(1) + V(1000);
  const Result<AmbiguityBlock> block = decode(bytes);
  ASSERT_TRUE(block.ok()) << block.error().message;
  EXPECT_EQ(block->first, 7);
  EXPECT_DOUBLE_EQ(block->nodes[1].entropy, 0.693);
  EXPECT_EQ(block->nodes[1].look_alikes, (std::vector<MapAppearanceNode::LookAlike>{{9, 0.001}, {10, 1}}));
  EXPECT_EQ(EncodeBlock(*block), V(0) + NoRuns() + bytes);
  EXPECT_EQ(RefusalOf(decode(V(64000) + NoRuns())), "");
  EXPECT_THAT(RefusalOf(decode(V(64001) + NoRuns())),
              HasSubstr("the entropy or look-alikes of node 8 make no sense"));
  EXPECT_EQ(RefusalOf(decode(V(0) + RunOf(11) + V(1))), "");
  EXPECT_THAT(RefusalOf(decode(V(0) + RunOf(12) + V(1))), HasSubstr("of node 8"));
  EXPECT_THAT(RefusalOf(decode(V(0) + RunOf(8) + V(1))), HasSubstr("of node 8"));
  EXPECT_EQ(RefusalOf(decode(V(0) + NoRuns(), 9)), "");
  EXPECT_THAT(RefusalOf(decode(V(0) + NoRuns(), 8)), HasSubstr("of node 8"));  // there is no such node
  EXPECT_THAT(RefusalOf(decode(V(0) + RunOf(9) + V(0))),
              HasSubstr("a look-alike of node 8 scores 0 thousandths"));
  EXPECT_THAT(RefusalOf(decode(V(0) + RunOf(9) + V(1001))), HasSubstr("scores 1001 thousandths"));
  EXPECT_THAT(RefusalOf(decode(V(0) + NoRuns() + 'x')), HasSubstr("bytes are left after 2 nodes"));
}

// Two landmarks of binary descriptors of 32 bytes, as varied as the test wants.
struct HandLandmarks {
  std::string regions = V(0), image_blocks = NoRuns();
  std::array<std::string, 2> class_steps = {Z(40), Z(-3)}, observations = {V(2), V(7)};
  uint8_t width = 1;
  std::array<int64_t, 3> least = {100, -200, 0};
  std::string offsets = std::string("\0\1\0\3\0\xff", 6);
  uint8_t bits = 2, last_level = 2;
  std::string levels = "\x05\x09\xff";
  std::string codes =
      std::string(15, '\0') + U8(0x24) + std::string(1, '\x1b');  // 0 1 2 0 at the end of the first 64

  std::string Bytes() const {
    BlobWriter writer;
    for (int i = 0; i < 2; ++i) writer.UInt64(EncodeCovariance(Eigen::Matrix3d::Zero()));
    const std::string covariances = writer.Take();
    return regions + image_blocks + class_steps[0] + class_steps[1] + observations[0] + observations[1] +
           U8(0) + U8(9) + covariances + U8(width) + U32(least[0]) + U32(least[1]) + U32(least[2]) + offsets +
           U8(bits) + U8(last_level) + levels + codes;
  }
};

Result<LandmarkBlock> DecodeLandmarks(const HandLandmarks& landmarks) {
  MapDirectory directory =
      DirectoryOf({{BlockKind::kRegions, 4}, {BlockKind::kImages, 9}, {BlockKind::kLandmarks, 20}});
  directory.set_descriptor_kind({.type = DescriptorType::kFloat, .num_values = 33});
  return DecodeLandmarkBlock(landmarks.Bytes(), EntryOf(BlockKind::kLandmarks, 7, 2), directory, "block");
}

std::string LandmarkRefusal(const std::function<void(HandLandmarks*)>& change) {
  HandLandmarks landmarks;
  change(&landmarks);
  return RefusalOf(DecodeLandmarks(landmarks));
}

// 66 values of 2 bits: 16 bytes, and half of one.
TEST(LandmarkBlockLimits, BytesAreReadAsThePageDrawsThem) {
  HandLandmarks landmarks;
  landmarks.regions = V(2) + V(1) + RunOf(1) + V(3) + RunOf(0, 2);
  landmarks.image_blocks = RunOf(0);
  landmarks.codes = std::string(15, '\0') + U8(0x24) + U8(0x06);  // 0 1 2 0, 2 1: lowest bits first
  const Result<LandmarkBlock> block = DecodeLandmarks(landmarks);
  ASSERT_TRUE(block.ok()) << block.error().message;
  EXPECT_EQ(block->first, 7);
  EXPECT_THAT(block->regions, ElementsAre(Pair(0, ElementsAre(8)), Pair(3, ElementsAre(7, 8))));
  EXPECT_THAT(block->image_blocks, ElementsAre(0));
  EXPECT_EQ(block->landmarks[0].class_id, 40u);
  EXPECT_EQ(block->landmarks[1].class_id, 37u);
  EXPECT_EQ(block->landmarks[1].num_observations, 7);
  EXPECT_EQ(block->landmarks[0].scale_m, 0);
  EXPECT_DOUBLE_EQ(block->landmarks[1].scale_m, 2e-6);
  EXPECT_LT((block->landmarks[0].position - Eigen::Vector3d(0.01, -0.0199, 0)).norm(), 1e-12);
  EXPECT_LT((block->landmarks[1].position - Eigen::Vector3d(0.0103, -0.02, 0.0255)).norm(), 1e-12);
  EXPECT_EQ(block->descriptors(0, 0), 5);
  EXPECT_EQ(block->descriptors(1, 28), 9);
  EXPECT_EQ(block->descriptors(1, 29), 255);
  EXPECT_EQ(block->descriptors(1, 30), 5);
  EXPECT_EQ(block->descriptors(1, 31), 255);
  EXPECT_EQ(block->descriptors(1, 32), 9);
  EXPECT_EQ(EncodeBlock(*block), landmarks.Bytes());
}

TEST(LandmarkBlockLimits, RegionsAndClassesAreInRange) {
  const auto regions = [](const std::string& bytes) {
    return LandmarkRefusal([&](HandLandmarks* l) { l->regions = bytes; });
  };
  EXPECT_EQ(regions(V(1) + V(4) + RunOf(1)), "");
  EXPECT_THAT(regions(V(1) + V(5) + RunOf(1)), HasSubstr("the regions of 2 landmarks make no sense"));
  EXPECT_THAT(regions(V(1) + V(0) + RunOf(1)), HasSubstr("the regions"));
  EXPECT_THAT(regions(V(2) + V(1) + RunOf(1) + V(4) + RunOf(1)), HasSubstr("the regions"));
  EXPECT_THAT(regions(V(2) + V(1) + RunOf(1) + V(0) + RunOf(1)), HasSubstr("the regions"));
  EXPECT_THAT(regions(V(1) + V(1) + RunOf(2)), HasSubstr("the regions"));
  EXPECT_THAT(regions(V(1'000'000)), HasSubstr("the regions"));
  EXPECT_THAT(LandmarkRefusal([](HandLandmarks* l) { l->image_blocks = RunOf(1); }),
              HasSubstr("the image blocks"));
  const auto classes = [](const std::string& first, const std::string& second) {
    return LandmarkRefusal([&](HandLandmarks* l) { l->class_steps = {first, second}; });
  };
  EXPECT_EQ(classes(Z(kInvalidClassId), Z(-int64_t{kInvalidClassId})), "");
  EXPECT_THAT(classes(Z(int64_t{kInvalidClassId} + 1), Z(0)), HasSubstr("the class ids of 2 landmarks"));
  EXPECT_THAT(classes(Z(-1), Z(0)), HasSubstr("the class ids"));
  EXPECT_THAT(classes(Z(kInvalidClassId), Z(1)), HasSubstr("the class ids"));
  for (const int64_t most : {int64_t{1} << 61, -(int64_t{1} << 62)})
    EXPECT_THAT(classes(Z(kInvalidClassId), Z(most)), HasSubstr("the class ids"));
  const auto observations = [](uint64_t num) {
    return LandmarkRefusal([&](HandLandmarks* l) { l->observations[1] = V(num); });
  };
  EXPECT_EQ(observations(2147483647), "");
  EXPECT_THAT(observations(2147483648), HasSubstr("the observations"));
}

TEST(LandmarkBlockLimits, PlacesAreWithin200Kilometres) {
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(LandmarkRefusal([&](HandLandmarks* l) {
                l->least[axis] = 2'000'000'000 - 255, l->offsets = std::string(6, '\xff');
              }),
              "");
    EXPECT_THAT(LandmarkRefusal([&](HandLandmarks* l) {
                  l->least[axis] = 2'000'000'001 - 255, l->offsets = std::string(6, '\xff');
                }),
                HasSubstr("the positions of 2 landmarks"));
    EXPECT_EQ(LandmarkRefusal([&](HandLandmarks* l) {
                l->least[axis] = -2'000'000'000, l->offsets = std::string(6, '\0');
              }),
              "");
    EXPECT_THAT(LandmarkRefusal([&](HandLandmarks* l) {
                  l->least[axis] = -2'000'000'001, l->offsets = std::string(6, '\0');
                }),
                HasSubstr("the positions"));
  }
  EXPECT_THAT(LandmarkRefusal([](HandLandmarks* l) { l->width = 0, l->offsets = ""; }),
              HasSubstr("the positions"));
  EXPECT_EQ(LandmarkRefusal([](HandLandmarks* l) { l->width = 4, l->offsets = std::string(24, '\0'); }), "");
  EXPECT_THAT(LandmarkRefusal([](HandLandmarks* l) { l->width = 5, l->offsets = std::string(30, '\0'); }),
              HasSubstr("the positions"));
  // Lowest byte first.
  HandLandmarks landmarks;
  landmarks.width = 3;
  landmarks.offsets = std::string("\1\2\3", 3) + std::string(15, '\0');
  EXPECT_DOUBLE_EQ(DecodeLandmarks(landmarks)->landmarks[0].position.x(), (100 + 0x030201) * 1e-4);
}

TEST(LandmarkBlockLimits, CodesOfDescriptorsHaveOneToEightBits) {
  const auto levels = [](uint8_t bits, size_t num_levels, size_t num_bytes) {
    return LandmarkRefusal([&](HandLandmarks* l) {
      l->bits = bits, l->last_level = static_cast<uint8_t>(num_levels - 1);
      l->levels = std::string(num_levels, '\1'), l->codes = std::string(num_bytes, '\0');
    });
  };
  EXPECT_EQ(levels(1, 2, 9), "");
  EXPECT_THAT(levels(0, 1, 0), HasSubstr("the descriptors of 2 landmarks"));
  EXPECT_THAT(levels(1, 3, 9), HasSubstr("the descriptors"));
  EXPECT_EQ(levels(2, 4, 17), "");
  EXPECT_THAT(levels(2, 5, 17), HasSubstr("the descriptors"));
  EXPECT_EQ(levels(8, 256, 66), "");
  EXPECT_THAT(levels(9, 256, 75), HasSubstr("the descriptors"));
  EXPECT_THAT(levels(2, 4, 16), HasSubstr("the descriptors"));
  EXPECT_THAT(levels(2, 4, 18), HasSubstr("the bytes of 2 landmarks"));
}

// As few bits and bytes as what occurs takes.
TEST(LandmarkBlockLimits, CodesAreAsShortAsTheValuesAllow) {
  LandmarkBlock block;
  block.landmarks.resize(8);
  const size_t before = 1 + 1 + 8 + 8 + 8 + 64;  // lists, class ids, observations, sizes, covariances
  for (const auto& [farthest, width] : std::vector<std::pair<int, int>>{
           {0, 1}, {255, 1}, {256, 2}, {65535, 2}, {65536, 3}, {16777215, 3}, {16777216, 4}}) {
    block.descriptors = DescriptorMatrix::Zero(8, kSiftDescriptorDim);
    block.landmarks[5].position = {0, 1e-4 * farthest, 0};
    EXPECT_EQ(EncodeBlock(block)[before], width) << farthest;
  }
  block.landmarks[5].position.setZero();
  for (const auto& [num_values, bits] : std::vector<std::pair<int, int>>{
           {1, 1}, {2, 1}, {3, 2}, {4, 2}, {5, 3}, {16, 4}, {17, 5}, {128, 7}, {129, 8}, {256, 8}}) {
    for (Eigen::Index i = 0; i < block.descriptors.size(); ++i)
      block.descriptors.data()[i] = static_cast<uint8_t>(i % num_values);
    const std::string bytes = EncodeBlock(block);
    EXPECT_EQ(bytes[before + 1 + 12 + 24], bits) << num_values;
    EXPECT_EQ(static_cast<uint8_t>(bytes[before + 1 + 12 + 24 + 1]), num_values - 1);
    EXPECT_EQ(bytes.size(), before + 1 + 12 + 24 + 2 + num_values + 16 * bits * 8) << num_values;
    const Result<LandmarkBlock> read =
        DecodeLandmarkBlock(bytes, EntryOf(BlockKind::kLandmarks, 0, 8), {}, "block");
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->descriptors, block.descriptors);
  }
}

// Two models of one landmark, of three and four sights.
std::string VisualBytes(const std::function<void(std::vector<std::string>*)>& change) {
  std::vector<std::string> parts = {
      V(3),
      F32(321.5F),
      F32(0.5F),
      F32(0),
      F32(2),
      F32(0.25F),  // camera, focal length, errors
      U8(3),
      V(0),
      V(9000),
      V(35999),            // headings
      V(2) + V(0) + V(0),  // of the models: 0 and 2
      U8(6 * 2 + 3),
      U8(1) + U8(9) + U8(0),
      RunOf(2, 3),  // length 2, noise 3; sizes; images 2 to 4
  };
  // Sights: x, y from -2048 px in 1/8, lowest byte first; the scale from -4 octaves in 1/16.
  for (int i = 0; i < 3; ++i)
    parts.push_back(std::string("\x08\x40\x00\x00", 4) + U8(static_cast<uint8_t>(64 + i)));
  parts.push_back(U8(0x80 | (6 * 4 + 5)) + U8(0) + U8(0) + U8(0) + RunOf(0, 3));
  for (int i = 0; i < 3; ++i) parts.push_back(std::string(4, '\xff') + U8(255));
  change(&parts);
  std::string bytes;
  for (const std::string& part : parts) bytes += part;
  return bytes;
}

Result<VisualBlock> DecodeVisual(const std::function<void(std::vector<std::string>*)>& change) {
  const MapDirectory directory = DirectoryOf({{BlockKind::kImages, 5}, {BlockKind::kLandmarks, 9}});
  return DecodeVisualBlock(VisualBytes(change), EntryOf(BlockKind::kLandmarkModels, 7, 1), directory,
                           "block");
}

TEST(VisualBlockLimits, BytesAreReadAsThePageDrawsThem) {
  const auto nothing = [](std::vector<std::string>*) {};
  const Result<VisualBlock> block = DecodeVisual(nothing);
  ASSERT_TRUE(block.ok()) << block.error().message;
  EXPECT_EQ(block->first, 7);
  const VisualMapData& part = block->part;
  EXPECT_EQ(part.camera_id, 3u);
  EXPECT_EQ(part.focal_px, 321.5F);
  EXPECT_EQ(part.errors, (VisualErrors{0.5F, 0, 2, 0.25F}));
  ASSERT_EQ(part.headings_deg.size(), 3u);
  EXPECT_DOUBLE_EQ(part.headings_deg[1], 90);
  EXPECT_DOUBLE_EQ(part.headings_deg[2], 359.99);
  const HeadingModel &first = part.landmarks[0][0], &second = part.landmarks[0][1];
  EXPECT_EQ(first.heading, 0);
  EXPECT_EQ(first.shape, (KernelShape{2, 3}));
  EXPECT_FALSE(first.predicts_badly);
  EXPECT_EQ(first.sigma, Eigen::Vector3d(1e-6, 2e-6, 0));
  EXPECT_EQ(first.sights[1], (LandmarkSight{3, {1, -2048, 1.0F / 16}}));
  EXPECT_EQ(second.heading, 2);
  EXPECT_EQ(second.shape, (KernelShape{4, 5}));
  EXPECT_TRUE(second.predicts_badly);
  EXPECT_EQ(second.sights[2], (LandmarkSight{2, {6143.875F, 6143.875F, 255.0F / 16 - 4}}));
  EXPECT_EQ(EncodeBlock(*block), VisualBytes(nothing));
}

TEST(VisualBlockLimits, NumbersAreInRange) {
  const auto refusal = [](size_t part, const std::string& bytes) {
    return RefusalOf(DecodeVisual([&](std::vector<std::string>* parts) { (*parts)[part] = bytes; }));
  };
  EXPECT_EQ(refusal(0, V(0xffffffff)), "");
  EXPECT_THAT(refusal(0, V(0x100000000)), HasSubstr("camera 4294967296 is not valid"));
  EXPECT_EQ(refusal(1, F32(0)), "");
  EXPECT_EQ(refusal(1, F32(999999)), "");
  for (const float bad : {-1.0F, 1e6F, std::nanf("")}) {
    EXPECT_THAT(refusal(1, F32(bad)), HasSubstr("focal length"));
    for (size_t error = 2; error < 6; ++error)
      EXPECT_THAT(refusal(error, F32(bad)), HasSubstr("errors are not valid"));
  }
  for (size_t error = 2; error < 6; ++error) EXPECT_EQ(refusal(error, F32(999999)), "");
  EXPECT_THAT(refusal(9, V(36000)), HasSubstr("heading 2 is 36000 hundredths of a degree"));
  EXPECT_THAT(refusal(9, V(9000)), HasSubstr("its 3 headings are not 1 to 64 ascending ones"));
  EXPECT_EQ(refusal(9, V(9001)), "");
  EXPECT_THAT(refusal(11, U8(6 * 5)), HasSubstr("there is no kernel 5, 0"));
  EXPECT_EQ(refusal(11, U8(6 * 4)), "");
  EXPECT_THAT(refusal(13, RunOf(2, 2)), HasSubstr("block"));
  EXPECT_THAT(refusal(13, RunOf(3, 3)), HasSubstr("the models of landmark 7 make no sense"));
  EXPECT_THAT(refusal(10, V(1) + V(6)), HasSubstr("the models of landmark 7"));
  EXPECT_THAT(refusal(19, std::string(5, '\0') + 'x'), HasSubstr("bytes are left after 1 landmarks"));
  EXPECT_THAT(refusal(19, std::string(4, '\0')), HasSubstr("the models of landmark 7"));
}

// 64 headings of one landmark that has no model.
TEST(VisualBlockLimits, ThereAreAtMost64Headings) {
  const auto refusal = [](int num_headings) {
    std::string bytes =
        V(3) + F32(0) + F32(0) + F32(0) + F32(0) + F32(0) + U8(static_cast<uint8_t>(num_headings));
    for (int i = 0; i < num_headings; ++i) bytes += V(i);
    return RefusalOf(DecodeVisualBlock(bytes + NoRuns(), EntryOf(BlockKind::kLandmarkModels, 0, 1),
                                       DirectoryOf({{BlockKind::kLandmarks, 1}}), "block"));
  };
  EXPECT_EQ(refusal(1), "");
  EXPECT_EQ(refusal(64), "");
  EXPECT_THAT(refusal(65), HasSubstr("its 65 headings"));
  EXPECT_THAT(refusal(0), HasSubstr("its 0 headings"));
}

VisualMapData RoundedOnce(float x, float y, float octave, double heading_deg) {
  VisualMapData data;
  data.headings_deg = {heading_deg};
  data.landmarks.resize(1);
  data.landmarks[0].push_back({.sigma = {1.02e-6, 0, 1}, .sights = {{0, {x, y, octave}}}});
  EXPECT_TRUE(RoundAsStored(&data).ok());
  return data;
}

TEST(RoundAsStored, RoundsToTheNearestThatCanBeStored) {
  const VisualMapData data = RoundedOnce(100.06F, -0.07F, 1.04F, 12.346);
  EXPECT_EQ(data.landmarks[0][0].sights[0].seen, Eigen::Vector3f(100, -0.125F, 1.0625F));
  EXPECT_DOUBLE_EQ(data.headings_deg[0], 12.35);
  EXPECT_DOUBLE_EQ(data.landmarks[0][0].sigma.x(), 1e-6);
  EXPECT_DOUBLE_EQ(RoundedOnce(0, 0, 0, 359.996).headings_deg[0], 0);
  EXPECT_DOUBLE_EQ(RoundedOnce(0, 0, 0, 359.994).headings_deg[0], 359.99);
  EXPECT_EQ(RoundedOnce(-2048, 6143, -9, 0).landmarks[0][0].sights[0].seen, Eigen::Vector3f(-2048, 6143, -4));
  EXPECT_EQ(RoundedOnce(6143, -2048, 99, 0).landmarks[0][0].sights[0].seen,
            Eigen::Vector3f(6143, -2048, 255.0F / 16 - 4));
}

}  // namespace
}  // namespace cairn
