#include "core/scene/mesh/label_map.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <random>
#include <string>

#include "core/scene/mesh/inflate.h"
#include "tests/scene_mesh/files.h"

namespace adhesim {
namespace {

std::string Gzip(const std::string& bytes) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string out(deflateBound(&stream, bytes.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

// 3 x 2 x 2 voxels, each of one byte.
const std::string kVoxels("\x00\x01\x00\x00\x00\x7f\xff\x00\x00\x00\x00\x00", 12);
const std::vector<std::uint8_t> kSolid = {0, 1, 0, 0, 0, 2, 3, 0, 0, 0, 0, 0};

std::string InrHeader(const std::string& size = "XDIM=3\nYDIM=2\nZDIM=2\n",
                      const std::string& bits = "8") {
  std::string header = "#INRIMAGE-4#{\n" + size + "VDIM=1\nTYPE=unsigned fixed\nPIXSIZE=" + bits +
                       " bits\nSCALE=2**0\nCPU=decm\nVX=0.5\nVY=1\nVZ=2\n";
  header.resize(252, '\n');
  return header + "##}\n";
}

std::string NrrdHeader(const std::string& fields = "") {
  std::string header = "NRRD0004\n# a comment\ntype: uchar\ndimension: 3\nsizes: 3 2 2\n" + fields;
  if (fields.find("encoding") == std::string::npos) header += "encoding: raw\n";
  return header + "\n";
}

void ExpectRefused(const std::string& bytes, const std::string& part) {
  const auto map = ParseLabelMap(bytes);
  ASSERT_FALSE(map.ok());
  EXPECT_NE(map.status().message().find(part), std::string::npos) << map.status();
}

TEST(LabelMap, ReadsInrAndItsGzip) {
  for (const std::string& bytes : {InrHeader() + kVoxels, Gzip(InrHeader() + kVoxels)}) {
    const auto map = ParseLabelMap(bytes);
    ASSERT_TRUE(map.ok()) << map.status();
    EXPECT_EQ(map->size, (std::array<int, 3>{3, 2, 2}));
    EXPECT_TRUE(map->spacing_m.isApprox(Vec3(0.0005, 0.001, 0.002), 1e-15));
    EXPECT_EQ(map->solid, kSolid);
  }
}

TEST(LabelMap, ReadsNrrdRawGzipAndWholeGzip) {
  const std::string spacings = "spacings: 0.5 1 2\n";
  for (const std::string& bytes :
       {NrrdHeader(spacings) + kVoxels, NrrdHeader(spacings + "encoding: gzip\n") + Gzip(kVoxels),
        Gzip(NrrdHeader(spacings) + kVoxels)}) {
    const auto map = ParseLabelMap(bytes);
    ASSERT_TRUE(map.ok()) << map.status();
    EXPECT_TRUE(map->spacing_m.isApprox(Vec3(0.0005, 0.001, 0.002), 1e-15));
    EXPECT_EQ(map->solid, kSolid);
  }
}

TEST(LabelMap, MirrorsALeftHandedImageBack) {
  const auto right =
      ParseLabelMap(NrrdHeader("space directions: (-0.5,0,0) (0,-1,0) (0,0,2)\n") + kVoxels);
  ASSERT_TRUE(right.ok()) << right.status();
  EXPECT_EQ(right->solid, kSolid);
  EXPECT_TRUE(right->spacing_m.isApprox(Vec3(0.0005, 0.001, 0.002), 1e-15));
  const auto left =
      ParseLabelMap(NrrdHeader("space directions: (0.5,0,0) (0,1,0) (0,0,-2)\n") + kVoxels);
  ASSERT_TRUE(left.ok()) << left.status();
  EXPECT_EQ(left->solid, (std::vector<std::uint8_t>{1, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 3}));
}

TEST(LabelMap, ReadsWideLabelsInAnyByteOrder) {
  std::string wide;  // the label in the high byte of every pair
  for (const char v : kVoxels) wide += std::string(1, '\0') + v;
  const auto inr = ParseLabelMap(InrHeader("XDIM=3\nYDIM=2\nZDIM=2\n", "16") + wide);
  ASSERT_TRUE(inr.ok()) << inr.status();
  EXPECT_EQ(inr->solid, kSolid);
  EXPECT_EQ(inr->labels, (std::vector<std::uint32_t>{0x100, 0x7f00, 0xff00}));
  std::string header = InrHeader("XDIM=3\nYDIM=2\nZDIM=2\n", "16");
  header.replace(header.find("CPU=decm"), 8, "CPU=sun\n");
  EXPECT_EQ(ParseLabelMap(header + wide)->labels, (std::vector<std::uint32_t>{1, 0x7f, 0xff}));
}

TEST(LabelMap, RefusesWhatIsNotALabelMap) {
  ExpectRefused("something else", "neither an INR");
  ExpectRefused("#INRIMAGE-4#{\nXDIM=3\n", "no end");
  ExpectRefused("NRRD0004\ntype: uchar\n", "no end");
  std::string real_numbers = InrHeader() + kVoxels;
  real_numbers.replace(real_numbers.find("unsigned fixed"), 14, "float         ");
  ExpectRefused(real_numbers, "whole-number labels");
  ExpectRefused(InrHeader("XDIM=3\nYDIM=2\nZDIM=2\n", "13") + kVoxels, "PIXSIZE");
  ExpectRefused(NrrdHeader("encoding: hex\n") + kVoxels, "raw or gzip");
  ExpectRefused(NrrdHeader("data file: other.raw\n"), "data file");
  ExpectRefused(NrrdHeader("space directions: (1,0,0) (0,1,0)\n") + kVoxels, "three vectors");
  ExpectRefused(NrrdHeader("spacings: 1 0 1\n") + kVoxels, "spacing");
  ExpectRefused(NrrdHeader("spacings: 1 nan 1\n") + kVoxels, "three numbers");
}

TEST(LabelMap, RefusesHugeImagesBeforeTakingMemory) {
  ExpectRefused(InrHeader("XDIM=100000\nYDIM=100000\nZDIM=100000\n") + kVoxels, "permitted");
  ExpectRefused(InrHeader("XDIM=100001\nYDIM=2\nZDIM=2\n") + kVoxels, "1..100000");
  ExpectRefused(InrHeader("XDIM=-3\nYDIM=2\nZDIM=2\n") + kVoxels, "1..100000");
  ExpectRefused(InrHeader("XDIM=99999999999999999999\nYDIM=2\nZDIM=2\n") + kVoxels, "1..100000");
}

TEST(LabelMap, RefusesTruncatedAndDamagedData) {
  ExpectRefused(InrHeader() + kVoxels.substr(0, 11), "there are 11");
  ExpectRefused(InrHeader("XDIM=700\nYDIM=700\nZDIM=700\n"), "there are 0");
  const std::string gzip = Gzip(InrHeader() + kVoxels);
  ExpectRefused(gzip.substr(0, gzip.size() - 10), "too early");
  std::string damaged = Gzip(InrHeader() + kVoxels);
  damaged[damaged.size() / 2] ^= 0x55;
  EXPECT_FALSE(ParseLabelMap(damaged).ok());
}

TEST(LabelMap, StopsInflatingWhereTheImageEnds) {
  // 8 MB of zeros after the image: only what the header announces is decompressed.
  const auto map = ParseLabelMap(Gzip(InrHeader() + kVoxels + std::string(8 << 20, '\0')));
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_EQ(map->solid, kSolid);
  const auto part = Inflate(Gzip(std::string(8 << 20, 'x')), 1000);
  ASSERT_TRUE(part.ok());
  EXPECT_EQ(part->size(), 1000u);
}

TEST(LabelMap, SurvivesWrongBytes) {
  std::mt19937 random(2);
  int refused = 0;
  const std::vector<std::string> files = {InrHeader() + kVoxels, Gzip(InrHeader() + kVoxels),
                                          NrrdHeader("spacings: 1 1 1\n") + kVoxels,
                                          NrrdHeader("encoding: gzip\n") + Gzip(kVoxels)};
  for (const std::string& file : files) {
    for (int i = 0; i < 2000; ++i) {
      std::string bytes = file;
      for (int change = 0; change < 3; ++change) {
        bytes[random() % bytes.size()] =
            static_cast<char>(random() % 3 == 0 ? random() : '0' + random() % 10);
      }
      if (random() % 4 == 0) bytes.resize(random() % bytes.size() + 1);
      refused += !ParseLabelMap(bytes).ok();
    }
  }
  EXPECT_GT(refused, 100);
}

TEST(LabelMap, IsKnownByItsName) {
  EXPECT_TRUE(IsLabelMapName("a/liver.inr.gz"));
  EXPECT_TRUE(IsLabelMapName("LIVER.NRRD"));
  EXPECT_FALSE(IsLabelMapName("liver.obj"));
  EXPECT_FALSE(IsLabelMapName("liver.gz"));
}

}  // namespace
}  // namespace adhesim
