#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace cairn {

// Files with a GPS block made byte by byte [EXIF 2.3 §4.6], so that they can be wrong in every way.
using Rationals = std::vector<std::pair<uint32_t, uint32_t>>;

struct GpsBlock {
  char latitude_ref = 'N';
  Rationals latitude = {{55, 1}, {41, 1}, {534, 10}};  // degrees, minutes, seconds
  char longitude_ref = 'E';
  Rationals longitude = {{13, 1}, {11, 1}, {434, 10}};
  int altitude_ref = 0;  // 1: below sea level
  Rationals altitude = {{375, 10}};
};

inline std::string LittleEndian16(uint32_t v) {
  return {static_cast<char>(v & 255), static_cast<char>(v >> 8 & 255)};
}
inline std::string LittleEndian32(uint32_t v) { return LittleEndian16(v & 65535) + LittleEndian16(v >> 16); }

// A JPEG file that holds nothing but an EXIF block of this TIFF data.
inline std::string ExifJpegOf(const std::string& tiff) {
  std::string block = "Exif";
  block += std::string(2, '\0') + tiff;
  const size_t length = block.size() + 2;
  return "\xff\xd8\xff\xe1" + std::string({static_cast<char>(length >> 8), static_cast<char>(length & 255)}) +
         block + "\xff\xd9";
}

// The start of TIFF data whose one entry leads to another directory, at byte 26.
inline std::string TiffLeadingTo(uint32_t tag) {
  std::string tiff = "II*";
  tiff += '\0';
  return tiff + LittleEndian32(8) + LittleEndian16(1) + LittleEndian16(tag) + LittleEndian16(4) +
         LittleEndian32(1) + LittleEndian32(26) + LittleEndian32(0);
}

// FocalLengthIn35mmFilm alone.
inline std::string ExifJpegOfFocalLength(uint32_t focal_mm) {
  return ExifJpegOf(TiffLeadingTo(0x8769) + LittleEndian16(1) + LittleEndian16(0xa405) + LittleEndian16(3) +
                    LittleEndian32(1) + LittleEndian32(focal_mm) + LittleEndian32(0));
}

// What a camera without a 35 mm equivalent says of its lens and its sensor.
struct LensBlock {
  std::pair<uint32_t, uint32_t> focal_mm = {72, 10};
  std::pair<uint32_t, uint32_t> per_unit = {10160, 1};  // FocalPlaneXResolution
  uint32_t unit = 2;                                    // inches
  uint32_t width_px = 3000, height_px = 4000;           // 0: not said
};
inline std::string ExifJpegOfLens(const LensBlock& lens) {
  constexpr uint32_t kNumEntries = 5, kLensIfd = 26, kValues = kLensIfd + 2 + 12 * kNumEntries + 4;
  const auto entry = [](uint32_t tag, uint32_t format, uint32_t value) {
    return LittleEndian16(tag) + LittleEndian16(format) + LittleEndian32(1) + LittleEndian32(value);
  };
  return ExifJpegOf(TiffLeadingTo(0x8769) + LittleEndian16(kNumEntries) + entry(0x920a, 5, kValues) +
                    entry(0xa002, 4, lens.width_px) + entry(0xa003, 3, lens.height_px) +
                    entry(0xa20e, 5, kValues + 8) + entry(0xa210, 3, lens.unit) + LittleEndian32(0) +
                    LittleEndian32(lens.focal_mm.first) + LittleEndian32(lens.focal_mm.second) +
                    LittleEndian32(lens.per_unit.first) + LittleEndian32(lens.per_unit.second));
}

// A GPS block alone.
inline std::string ExifJpeg(const GpsBlock& gps) {
  constexpr int kNumEntries = 6;
  constexpr uint32_t kGpsIfd = 26, kValues = kGpsIfd + 2 + 12 * kNumEntries + 4;
  std::string entries, values;
  const auto add = [&](uint32_t tag, uint32_t format, uint32_t count, const std::string& value) {
    entries += LittleEndian16(tag) + LittleEndian16(format) + LittleEndian32(count) + value;
  };
  const auto add_letter = [&](uint32_t tag, char letter) { add(tag, 2, 2, std::string({letter, 0, 0, 0})); };
  const auto add_rationals = [&](uint32_t tag, const Rationals& rationals) {
    add(tag, 5, static_cast<uint32_t>(rationals.size()),
        LittleEndian32(kValues + static_cast<uint32_t>(values.size())));
    for (const auto& [numerator, denominator] : rationals)
      values += LittleEndian32(numerator) + LittleEndian32(denominator);
  };
  add_letter(1, gps.latitude_ref);
  add_rationals(2, gps.latitude);
  add_letter(3, gps.longitude_ref);
  add_rationals(4, gps.longitude);
  add(5, 1, 1, LittleEndian32(static_cast<uint32_t>(gps.altitude_ref)));
  add_rationals(6, gps.altitude);
  return ExifJpegOf(TiffLeadingTo(0x8825) + LittleEndian16(kNumEntries) + entries + LittleEndian32(0) +
                    values);
}

}  // namespace cairn
