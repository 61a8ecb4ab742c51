#include "core/capture/exif.h"

#include <libexif/exif-data.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "core/base/printable.h"
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

// A number of one or two times 16 bits.
double IntegerOf(const ExifEntry* entry, ExifByteOrder order) {
  if (entry == nullptr) return 0;
  if (entry->format == EXIF_FORMAT_SHORT && entry->size >= 2) return exif_get_short(entry->data, order);
  if (entry->format == EXIF_FORMAT_LONG && entry->size >= 4) return exif_get_long(entry->data, order);
  return 0;
}

// A line of ASCII without blanks at its ends.
std::string LineOf(const ExifEntry* entry) {
  if (entry == nullptr || entry->format != EXIF_FORMAT_ASCII) return {};
  const std::string bytes(reinterpret_cast<const char*>(entry->data), entry->size);
  const std::string text = bytes.substr(0, bytes.find('\0'));
  const size_t first = text.find_first_not_of(' ');
  if (first == std::string::npos) return {};
  return Printable(text.substr(first, text.find_last_not_of(' ') + 1 - first));
}

// Millimetres of a FocalPlaneResolutionUnit; inches where it is not said.  4 and 5 are in no edition of EXIF,
// but cameras write them.
double UnitMm(double unit) {
  if (unit == 3) return 10;
  if (unit == 4) return 1;
  if (unit == 5) return 0.001;
  return 25.4;
}

void ReadLens(const ExifData* exif, ExifByteOrder order, ExifTags* tags) {
  const auto entry = [&](ExifIfd ifd, ExifTag tag) { return exif_content_get_entry(exif->ifd[ifd], tag); };
  const auto lens = [&](ExifTag tag) { return entry(EXIF_IFD_EXIF, tag); };
  const ExifEntry* film = lens(EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (film != nullptr && film->format == EXIF_FORMAT_SHORT)
    tags->focal_length_35mm_mm = IntegerOf(film, order);
  tags->focal_length_mm = RationalOf(lens(EXIF_TAG_FOCAL_LENGTH), 0, order).value_or(0);
  const double per_unit = RationalOf(lens(EXIF_TAG_FOCAL_PLANE_X_RESOLUTION), 0, order).value_or(0);
  tags->sensor_px_per_mm = per_unit / UnitMm(IntegerOf(lens(EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT), order));
  tags->image_side_px = std::max(IntegerOf(lens(EXIF_TAG_PIXEL_X_DIMENSION), order),
                                 IntegerOf(lens(EXIF_TAG_PIXEL_Y_DIMENSION), order));
  const std::string make = LineOf(entry(EXIF_IFD_0, EXIF_TAG_MAKE));
  const std::string model = LineOf(entry(EXIF_IFD_0, EXIF_TAG_MODEL));
  tags->camera = make.empty() || model.starts_with(make) ? model : model.empty() ? make : make + " " + model;
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
  ReadLens(exif.get(), order, &tags);
  ReadGps(exif->ifd[EXIF_IFD_GPS], order, &tags);
  return tags;
}

const char* FocalSourceText(FocalSource source) {
  return source == FocalSource::kFilmEquivalent
             ? "35 mm equivalents in EXIF"
             : "the lens and the sensor's pixels in EXIF (FocalLength, FocalPlaneXResolution)";
}

std::optional<ExifFocal> FocalOf(const ExifTags& tags, double image_side_px) {
  constexpr double kFilmWidthMm = 36, kMinSensorMm = 1, kMaxSensorMm = 100;
  constexpr double kMinFocalRatio = 0.044, kMaxFocalRatio = 57;  // of the longer side: 170 and 1 degrees
  if (tags.focal_length_35mm_mm > 0) {
    return ExifFocal{tags.focal_length_35mm_mm / kFilmWidthMm * image_side_px, FocalSource::kFilmEquivalent};
  }
  if (tags.focal_length_mm <= 0 || tags.sensor_px_per_mm <= 0) return std::nullopt;
  const double side_then_px = tags.image_side_px > 0 ? tags.image_side_px : image_side_px;
  const double sensor_mm = side_then_px / tags.sensor_px_per_mm;
  const double focal_ratio = tags.focal_length_mm / sensor_mm;
  if (sensor_mm < kMinSensorMm || sensor_mm > kMaxSensorMm || focal_ratio < kMinFocalRatio ||
      focal_ratio > kMaxFocalRatio)
    return std::nullopt;
  return ExifFocal{focal_ratio * image_side_px, FocalSource::kSensorPixels};
}

}  // namespace cairn
