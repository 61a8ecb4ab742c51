#include "core/capture/exif.h"

#include <libexif/exif-data.h>

#include <cmath>
#include <memory>

#include "core/files/input_file.h"

namespace cairn {
namespace {

constexpr int kBelowSeaLevel = 1;  // GPSAltitudeRef [EXIF 2.3 §4.6.6]

// Number i of an entry of unsigned rationals.
std::optional<double> RationalOf(const ExifEntry* entry, unsigned i, ExifByteOrder order) {
  if (entry == nullptr || entry->format != EXIF_FORMAT_RATIONAL || entry->components <= i ||
      entry->size < 8 * (i + 1)) {
    return std::nullopt;
  }
  const ExifRational rational = exif_get_rational(entry->data + 8 * i, order);
  if (rational.denominator == 0) return std::nullopt;
  return static_cast<double>(rational.numerator) / rational.denominator;
}

char LetterOf(const ExifEntry* entry) {
  if (entry == nullptr || entry->format != EXIF_FORMAT_ASCII || entry->size == 0) return '\0';
  return static_cast<char>(entry->data[0]);
}

// Degrees, minutes and seconds as a signed angle.
std::optional<double> AngleOf(const ExifEntry* entry, char hemisphere, char positive, char negative,
                              double max_deg, ExifByteOrder order) {
  if (hemisphere != positive && hemisphere != negative) return std::nullopt;
  double angle_deg = 0, unit_deg = 1;
  for (unsigned i = 0; i < 3; ++i, unit_deg /= 60) {
    const auto number = RationalOf(entry, i, order);
    if (!number) return std::nullopt;
    angle_deg += *number * unit_deg;
  }
  if (angle_deg > max_deg) return std::nullopt;
  return hemisphere == positive ? angle_deg : -angle_deg;
}

void ReadGps(const ExifContent* gps, ExifByteOrder order, ExifTags* tags) {
  const auto entry = [&](int tag) {
    return exif_content_get_entry(const_cast<ExifContent*>(gps), static_cast<ExifTag>(tag));
  };
  const auto latitude =
      AngleOf(entry(EXIF_TAG_GPS_LATITUDE), LetterOf(entry(EXIF_TAG_GPS_LATITUDE_REF)), 'N', 'S', 90, order);
  const auto longitude = AngleOf(entry(EXIF_TAG_GPS_LONGITUDE), LetterOf(entry(EXIF_TAG_GPS_LONGITUDE_REF)),
                                 'E', 'W', 180, order);
  if (!latitude || !longitude) return;
  tags->gps = GeodeticPosition{*latitude, *longitude, 0};
  const auto altitude = RationalOf(entry(EXIF_TAG_GPS_ALTITUDE), 0, order);
  if (!altitude) return;
  const ExifEntry* reference = entry(EXIF_TAG_GPS_ALTITUDE_REF);
  const bool is_below = reference != nullptr && reference->format == EXIF_FORMAT_BYTE &&
                        reference->size >= 1 && reference->data[0] == kBelowSeaLevel;
  tags->gps->altitude_m = is_below ? -*altitude : *altitude;
  tags->has_altitude = true;
}

}  // namespace

ExifTags ReadExif(const std::string& path) {
  ExifTags tags;
  if (!CheckInputFile(path).ok()) return tags;
  const std::unique_ptr<ExifData, void (*)(ExifData*)> exif(exif_data_new_from_file(path.c_str()),
                                                            exif_data_unref);
  if (exif == nullptr) return tags;
  const ExifByteOrder order = exif_data_get_byte_order(exif.get());
  const ExifEntry* focal =
      exif_content_get_entry(exif->ifd[EXIF_IFD_EXIF], EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (focal != nullptr && focal->format == EXIF_FORMAT_SHORT && focal->size >= 2) {
    tags.focal_length_35mm_mm = exif_get_short(focal->data, order);
  }
  ReadGps(exif->ifd[EXIF_IFD_GPS], order, &tags);
  return tags;
}

}  // namespace cairn
