#include "sim/render/paint.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <opencv2/imgproc.hpp>

namespace cairn::sim {
namespace {

cv::Scalar Grey(double value) { return cv::Scalar(std::clamp(value, 0.0, 255.0)); }

// Sum of smooth noise over octaves from `largest_px` down to `smallest_px`, with amplitude proportional to
// wavelength^exponent, scaled to the standard deviation `sigma` and added to the picture.
void AddNoise(cv::Mat picture, double largest_px, double smallest_px, double sigma, Random& random,
              double stretch_x = 1, double stretch_y = 1, double exponent = 0.5) {
  cv::Mat sum = cv::Mat::zeros(picture.size(), CV_32F);
  double variance = 0;
  for (double wavelength = largest_px; wavelength >= smallest_px; wavelength /= 2) {
    const int cols = static_cast<int>(picture.cols / (wavelength * stretch_x)) + 3;
    const int rows = static_cast<int>(picture.rows / (wavelength * stretch_y)) + 3;
    cv::Mat coarse(rows, cols, CV_32F), fine;
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < cols; ++x) coarse.at<float>(y, x) = static_cast<float>(random.Uniform(-1, 1));
    }
    // The first lattice point falls at a random place, so that lattices of octaves do not coincide.
    const double shift_y = random.Uniform(), shift_x = random.Uniform();
    const cv::Matx23d map(1 / (wavelength * stretch_x), 0, shift_x, 0, 1 / (wavelength * stretch_y), shift_y);
    cv::warpAffine(coarse, fine, map, picture.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                   cv::BORDER_REPLICATE);
    const double amplitude = std::pow(wavelength, exponent);
    variance += amplitude * amplitude / 3 * 0.5;
    cv::scaleAdd(fine, amplitude, sum, sum);
  }
  if (variance <= 0) return;
  cv::Mat values;
  picture.convertTo(values, CV_32F);
  cv::scaleAdd(sum, sigma / std::sqrt(variance), values, values);
  values.convertTo(picture, CV_8U);
}

// A closed curve of 3 to 9 corners around a centre; filled.
void FillBlob(cv::Mat picture, cv::Point2d centre, double radius, double value, Random& random) {
  if (random.Uniform() < 0.3) {
    const double angle_deg = random.Uniform(0, 180), aspect = random.Uniform(0.4, 1);
    const cv::RotatedRect ellipse(
        cv::Point2f(centre),
        cv::Size2f(static_cast<float>(2 * radius), static_cast<float>(2 * radius * aspect)),
        static_cast<float>(angle_deg));
    cv::ellipse(picture, ellipse, Grey(value), cv::FILLED, cv::LINE_AA);
    return;
  }
  constexpr int kShift = 4;  // fractional bits of corners
  const int num_corners = static_cast<int>(random.UniformInt(3, 9));
  const double start = random.Uniform(0, 2 * std::numbers::pi);
  std::vector<cv::Point> corners;
  for (int i = 0; i < num_corners; ++i) {
    const double angle = start + 2 * std::numbers::pi * (i + random.Uniform(-0.3, 0.3)) / num_corners;
    const double r = radius * random.Uniform(0.6, 1.1);
    corners.emplace_back(static_cast<int>((centre.x + r * std::cos(angle)) * (1 << kShift)),
                         static_cast<int>((centre.y + r * std::sin(angle)) * (1 << kShift)));
  }
  cv::fillPoly(picture, std::vector<std::vector<cv::Point>>{corners}, Grey(value), cv::LINE_AA, kShift);
}

// The same around a random place.
void FillBlobSomewhere(cv::Mat picture, double radius, double value, Random& random) {
  const double x = random.Uniform(0, picture.cols), y = random.Uniform(0, picture.rows);
  FillBlob(picture, {x, y}, radius, value, random);
}

// Opaque shapes over each other with radii of density r^-3: the statistics of natural images at every scale
// ("dead leaves").  `density` is the number of times that the shapes cover the picture.
void PaintLeaves(cv::Mat picture, double smallest_px, double density, Random& random) {
  const double largest = 0.35 * std::min(picture.cols, picture.rows);
  if (largest <= smallest_px) return;
  // E[r^2] for density r^-3 on [a, b] is 2 ln(b/a) / (1/a^2 - 1/b^2).
  const double a2 = 1 / (smallest_px * smallest_px), b2 = 1 / (largest * largest);
  const double mean_area = 2.2 * 2 * std::log(largest / smallest_px) / (a2 - b2);
  const int num_shapes = static_cast<int>(density * picture.cols * picture.rows / mean_area);
  for (int i = 0; i < num_shapes; ++i) {
    const double radius = 1 / std::sqrt(random.Uniform(b2, a2));
    const double y = random.Uniform(0, picture.rows), x = random.Uniform(0, picture.cols);
    FillBlob(picture, {x, y}, radius, random.Uniform(15, 240), random);
  }
}

std::string RandomWord(Random& random) {
  std::string word;
  for (int64_t i = random.UniformInt(2, 9); i > 0; --i)
    word += static_cast<char>('A' + random.UniformInt(0, 25));
  return word;
}

// Lines of text in sizes from headline to small print.
void PaintText(cv::Mat picture, Random& random) {
  const bool dark = random.Uniform() < 0.35;
  const double paper = dark ? random.Uniform(20, 70) : random.Uniform(190, 240);
  const double ink = dark ? random.Uniform(190, 245) : random.Uniform(10, 60);
  picture.setTo(Grey(paper));
  const int margin = std::max(3, picture.cols / 20);
  double size = std::max(18.0, picture.rows * random.Uniform(0.12, 0.3));
  for (double y = margin; y + size < picture.rows - margin;) {
    const int fonts[] = {cv::FONT_HERSHEY_SIMPLEX, cv::FONT_HERSHEY_DUPLEX, cv::FONT_HERSHEY_TRIPLEX,
                         cv::FONT_HERSHEY_COMPLEX};
    const int font = fonts[random.UniformInt(0, 3)];
    const int thickness = std::max(1, static_cast<int>(size / 9));
    const double scale = size / 30;  // these fonts are about 22 px high, 30 with descenders
    for (double x = margin; x < picture.cols - margin;) {
      const std::string word = RandomWord(random);
      int baseline = 0;
      const cv::Size extent = cv::getTextSize(word, font, scale, thickness, &baseline);
      if (x + extent.width > picture.cols - margin && x > margin) break;
      cv::putText(picture, word, cv::Point(static_cast<int>(x), static_cast<int>(y + 0.8 * size)), font,
                  scale, Grey(ink), thickness, cv::LINE_AA);
      x += extent.width + 0.6 * size;
    }
    y += size * random.Uniform(1.2, 1.6);
    if (random.Uniform() < 0.4)
      size = std::clamp(size * random.Uniform(0.5, 1.2), 18.0, std::max(18.0, picture.rows * 0.3));
    if (random.Uniform() < 0.12) {  // a small picture between the lines
      const int h = std::min(static_cast<int>(3 * size) + 12, picture.rows - margin - static_cast<int>(y));
      const int w = std::min(static_cast<int>(h * random.Uniform(1, 2)), picture.cols - 2 * margin);
      if (h > 12 && w > 12) {
        const int x = margin + static_cast<int>(random.Uniform() * (picture.cols - 2 * margin - w));
        PaintLeaves(picture(cv::Rect(x, static_cast<int>(y), w, h)), 8, 1, random);
        y += h + 0.4 * size;
      }
    }
  }
}

// Contours of a random landscape: curved bands at all scales.
void PaintContours(cv::Mat picture, Random& random) {
  cv::Mat field(picture.size(), CV_8UC1, Grey(128));
  AddNoise(field, picture.cols / 2.0, 24, 45, random, 1, 1, 0.9);
  const int num_bands = static_cast<int>(random.UniformInt(5, 9));
  uint8_t tones[256];
  std::vector<double> band_tones(num_bands + 1);
  for (double& tone : band_tones) tone = random.Uniform(20, 240);
  for (int v = 0; v < 256; ++v) tones[v] = static_cast<uint8_t>(band_tones[v * num_bands / 256]);
  cv::LUT(field, cv::Mat(1, 256, CV_8UC1, tones), picture);
  PaintLeaves(picture, 10, 0.1, random);
}

void PaintPoster(cv::Mat picture, Random& random) {
  const double kind = random.Uniform();
  const int border = std::max(2, std::min(picture.cols, picture.rows) / 40);
  picture.setTo(Grey(random.Uniform() < 0.5 ? random.Uniform(200, 245) : random.Uniform(10, 60)));
  cv::Mat inner = picture(cv::Rect(border, border, picture.cols - 2 * border, picture.rows - 2 * border));
  if (kind < 0.4) {
    inner.setTo(Grey(random.Uniform(60, 200)));
    PaintLeaves(inner, 12, random.Uniform(0.8, 1.5), random);
  } else if (kind < 0.6) {
    PaintContours(inner, random);
  } else if (kind < 0.8) {
    PaintText(inner, random);
  } else {  // a picture over a text
    const int split = static_cast<int>(inner.rows * random.Uniform(0.4, 0.7));
    PaintLeaves(inner.rowRange(0, split), 12, 1.2, random);
    PaintText(inner.rowRange(split, inner.rows), random);
  }
}

// Sheets of paper pinned at small angles.
void PaintNotices(cv::Mat picture, double texel_m, Random& random) {
  picture.setTo(Grey(random.Uniform(90, 150)));
  AddNoise(picture, 16, 2, 10, random);
  const int num_sheets = static_cast<int>(picture.cols * picture.rows * texel_m * texel_m * 12);
  for (int i = 0; i < num_sheets; ++i) {
    const int w = static_cast<int>(random.Uniform(0.08, 0.25) / texel_m);
    const int h = static_cast<int>(w * random.Uniform(0.7, 1.5));
    cv::Mat sheet(h, w, CV_8UC1), placed, mask;
    if (random.Uniform() < 0.6) {
      PaintText(sheet, random);
    } else {
      sheet.setTo(Grey(random.Uniform(60, 230)));
      PaintLeaves(sheet, 8, 0.8, random);
    }
    const double angle = random.Normal(0, 0.12), c = std::cos(angle), s = std::sin(angle);
    const double y = random.Uniform(0, picture.rows), x = random.Uniform(0, picture.cols);
    const cv::Matx23d map(c, -s, x - w / 2.0, s, c, y - h / 2.0);
    cv::warpAffine(sheet, placed, map, picture.size());
    cv::warpAffine(cv::Mat(sheet.size(), CV_8UC1, Grey(255)), mask, map, picture.size());
    placed.copyTo(picture, mask > 127);
  }
}

void PaintBrick(cv::Mat picture, double texel_m, Random& random) {
  const double mortar = random.Uniform(130, 200), tone = random.Uniform(70, 140);
  const double brick_h = random.Uniform(0.07, 0.12) / texel_m, brick_w = brick_h * random.Uniform(2.2, 3.2);
  picture.setTo(Grey(mortar));
  const double joint = std::max(2.0, 0.012 / texel_m);
  int row = 0;
  for (double y = -random.Uniform() * brick_h; y < picture.rows; y += brick_h, ++row) {
    for (double x = -random.Uniform(0.3, 0.7) * brick_w * (1 + row % 2); x < picture.cols; x += brick_w) {
      const cv::Rect brick(
          cv::Point(static_cast<int>(x), static_cast<int>(y)),
          cv::Point(static_cast<int>(x + brick_w - joint), static_cast<int>(y + brick_h - joint)));
      cv::rectangle(picture, brick, Grey(tone + random.Normal(0, 28)), cv::FILLED);
      if (random.Uniform() < 0.35) {  // a chip or a stain
        const double value = tone + random.Normal(0, 60), radius = brick_h * random.Uniform(0.12, 0.4);
        const double stain_x = x + random.Uniform() * brick_w, stain_y = y + random.Uniform() * brick_h;
        FillBlob(picture, {stain_x, stain_y}, radius, value, random);
      }
    }
  }
  AddNoise(picture, 64, 2, 6, random);
}

void PaintWood(cv::Mat picture, double texel_m, bool vertical, Random& random) {
  cv::Mat planks = vertical ? cv::Mat(picture.cols, picture.rows, CV_8UC1) : picture;  // grain along x
  const double tone = random.Uniform(80, 170);
  double y = 0;
  while (y < planks.rows) {
    const double height = random.Uniform(0.1, 0.16) / texel_m;
    const int y0 = static_cast<int>(y), y1 = std::min(planks.rows, static_cast<int>(y + height));
    double x = -random.Uniform(0, 0.8) / texel_m;
    while (x < planks.cols && y1 > y0) {
      const double length = random.Uniform(0.6, 1.4) / texel_m;
      const int x0 = std::max(0, static_cast<int>(x)),
                x1 = std::min(planks.cols, static_cast<int>(x + length));
      if (x1 > x0) {
        cv::Mat plank = planks(cv::Rect(x0, y0, x1 - x0, y1 - y0));
        plank.setTo(Grey(tone + random.Normal(0, 16)));
        AddNoise(plank, 16, 2, 7, random, 8, 1);
        for (int64_t k = random.UniformInt(0, 3); k > 0; --k) {  // knots
          const double knot_y = random.Uniform(0, plank.rows), knot_x = random.Uniform(0, plank.cols);
          const double radius = random.Uniform(0.006, 0.022) / texel_m;
          FillBlob(plank, {knot_x, knot_y}, 1.5 * radius, tone - random.Uniform(15, 40), random);
          FillBlob(plank, {knot_x, knot_y}, 0.8 * radius, tone - random.Uniform(45, 80), random);
        }
        cv::rectangle(plank, cv::Rect(0, 0, plank.cols, plank.rows), Grey(tone - 55), 1);
      }
      x += length;
    }
    y += height;
  }
  if (vertical) cv::transpose(planks, picture);
}

void PaintMaterial(cv::Mat picture, double texel_m, Material material, Random& random) {
  switch (material) {
    case Material::kBrick:
      PaintBrick(picture, texel_m, random);
      return;
    case Material::kWood:
      PaintWood(picture, texel_m, random.Uniform() < 0.5, random);
      return;
    case Material::kPlaster:
      picture.setTo(Grey(random.Uniform(150, 205)));
      AddNoise(picture, 256, 4, 10, random, 1, 1, 0.5);
      break;
    case Material::kConcrete:
      picture.setTo(Grey(random.Uniform(110, 160)));
      AddNoise(picture, 128, 4, 14, random, 1, 1, 0.5);
      break;
    case Material::kWallpaper: {
      const double tone = random.Uniform(120, 200);
      picture.setTo(Grey(tone));
      AddNoise(picture, 128, 4, 6, random);
      const double area_m2 = picture.cols * picture.rows * texel_m * texel_m;
      for (int i = static_cast<int>(area_m2 * 60); i > 0; --i) {
        const double value = tone + random.Normal(0, 45), radius = random.Uniform(0.008, 0.05) / texel_m;
        FillBlobSomewhere(picture, radius, value, random);
      }
      return;
    }
  }
  // Stains and scratches, few and at all sizes.
  const double area_m2 = picture.cols * picture.rows * texel_m * texel_m;
  const double tone = cv::mean(picture)[0];
  for (int i = static_cast<int>(area_m2 * 18); i > 0; --i) {
    const double value = tone + random.Normal(0, 30);
    const double radius = 0.006 / texel_m / std::sqrt(random.Uniform(0.02, 1));
    FillBlobSomewhere(picture, radius, value, random);
  }
}

}  // namespace

cv::Mat PaintWallPanel(int width_px, int height_px, double texel_m, Material material, Random& random) {
  cv::Mat picture(height_px, width_px, CV_8UC1);
  PaintMaterial(picture, texel_m, material, random);
  // One or two things hang on the wall between knee and door height, where a robot sees them.
  const int num_things = static_cast<int>(random.UniformInt(1, 2));
  for (int i = 0; i < num_things; ++i) {
    const double kind = random.Uniform();
    const int w = std::min(width_px - 4, static_cast<int>(random.Uniform(0.35, 1.1) / texel_m));
    const int h = std::min(height_px - 4, static_cast<int>(random.Uniform(0.3, 0.9) / texel_m));
    if (w < 24 || h < 24) continue;
    const double centre_m = random.Uniform(0.7, 1.9);  // above the floor
    const int y =
        std::clamp(static_cast<int>(height_px - centre_m / texel_m - h / 2.0), 2, height_px - h - 2);
    const int x = 2 + static_cast<int>(random.Uniform() * (width_px - 4 - w));
    cv::Mat thing = picture(cv::Rect(x, y, w, h));
    if (kind < 0.7) {
      PaintPoster(thing, random);
    } else {
      PaintNotices(thing, texel_m, random);
    }
  }
  const int skirting = std::max(2, static_cast<int>(0.08 / texel_m));
  picture.rowRange(std::max(0, height_px - skirting), height_px).setTo(Grey(70));
  return picture;
}

cv::Mat PaintLintel(int width_px, int height_px, double texel_m, Material material, Random& random) {
  cv::Mat picture(height_px, width_px, CV_8UC1);
  PaintMaterial(picture, texel_m, material, random);
  const int w = static_cast<int>(width_px * random.Uniform(0.4, 0.8)), h = static_cast<int>(height_px * 0.5);
  if (w >= 24 && h >= 24) {
    PaintText(picture(cv::Rect(static_cast<int>(random.Uniform() * (width_px - w)), height_px / 5, w, h)),
              random);
  }
  return picture;
}

cv::Mat PaintFurnitureFace(int width_px, int height_px, double texel_m, Random& random) {
  cv::Mat picture(height_px, width_px, CV_8UC1);
  const double kind = random.Uniform();
  if (kind < 0.6) {
    PaintWood(picture, texel_m, random.Uniform() < 0.5, random);
  } else {
    picture.setTo(Grey(random.Uniform(60, 210)));
    AddNoise(picture, 64, 2, 7, random);
  }
  const double area_m2 = picture.cols * picture.rows * texel_m * texel_m;
  for (int i = 1 + static_cast<int>(area_m2 * 5); i > 0; --i) {  // labels, stickers, things
    const int w = std::min(width_px - 2, static_cast<int>(random.Uniform(0.06, 0.35) / texel_m));
    const int h = std::min(height_px - 2, static_cast<int>(w * random.Uniform(0.5, 1.4)));
    if (w < 16 || h < 16) continue;
    const int y = static_cast<int>(random.Uniform() * (height_px - h));
    const int x = static_cast<int>(random.Uniform() * (width_px - w));
    PaintPoster(picture(cv::Rect(x, y, w, h)), random);
  }
  cv::rectangle(picture, cv::Rect(0, 0, width_px, height_px), Grey(45),
                std::max(1, static_cast<int>(0.01 / texel_m)));
  return picture;
}

cv::Mat PaintFloor(const Rect& bounds, const std::vector<Room>& rooms, double texel_m, uint64_t seed) {
  cv::Mat picture(static_cast<int>(std::ceil(bounds.depth() / texel_m)),
                  static_cast<int>(std::ceil(bounds.width() / texel_m)), CV_8UC1, Grey(110));
  for (size_t r = 0; r < rooms.size(); ++r) {
    Random random(MixSeed(seed, r));
    const Rect& rect = rooms[r].rect;
    const cv::Rect area = cv::Rect(cv::Point(static_cast<int>((rect.x0 - bounds.x0) / texel_m),
                                             static_cast<int>((bounds.y1 - rect.y1) / texel_m)),
                                   cv::Point(static_cast<int>((rect.x1 - bounds.x0) / texel_m),
                                             static_cast<int>((bounds.y1 - rect.y0) / texel_m))) &
                          cv::Rect(0, 0, picture.cols, picture.rows);
    if (area.empty()) continue;
    cv::Mat floor = picture(area);
    const double tone = random.Uniform(70, 150), kind = random.Uniform();
    if (kind < 0.35) {
      PaintWood(floor, texel_m, random.Uniform() < 0.5, random);
    } else if (kind < 0.7) {  // carpet with motifs
      floor.setTo(Grey(tone));
      AddNoise(floor, 64, 2, 10, random, 1, 1, 0.3);
      for (int i = static_cast<int>(rect.area() * 14); i > 0; --i) {
        const double value = tone + random.Normal(0, 40), radius = random.Uniform(0.015, 0.12) / texel_m;
        FillBlobSomewhere(floor, radius, value, random);
      }
    } else {  // tiles
      const double tile = random.Uniform(0.2, 0.4) / texel_m;
      for (double y = 0; y < floor.rows; y += tile) {
        for (double x = 0; x < floor.cols; x += tile) {
          cv::Mat one = floor(cv::Rect(cv::Point(static_cast<int>(x), static_cast<int>(y)),
                                       cv::Point(static_cast<int>(x + tile), static_cast<int>(y + tile))) &
                              cv::Rect(0, 0, floor.cols, floor.rows));
          one.setTo(Grey(tone + random.Normal(0, 14)));
          if (random.Uniform() < 0.6) {
            const double value = tone + random.Normal(0, 35), radius = random.Uniform(0.05, 0.3) * tile;
            FillBlobSomewhere(one, radius, value, random);
          }
          cv::rectangle(one, cv::Rect(0, 0, one.cols, one.rows), Grey(tone - 40), 1);
        }
      }
      AddNoise(floor, 32, 2, 7, random);
    }
  }
  return picture;
}

cv::Mat PaintCeiling(const Rect& bounds, double texel_m, uint64_t seed) {
  Random random(seed);
  cv::Mat picture(static_cast<int>(std::ceil(bounds.depth() / texel_m)),
                  static_cast<int>(std::ceil(bounds.width() / texel_m)), CV_8UC1, Grey(205));
  AddNoise(picture, 32, 2, 4, random);
  const double tile = 0.6 / texel_m;
  for (double y = 0; y < picture.rows; y += tile) {
    for (double x = 0; x < picture.cols; x += tile) {
      cv::Mat one = picture(cv::Rect(cv::Point(static_cast<int>(x), static_cast<int>(y)),
                                     cv::Point(static_cast<int>(x + tile), static_cast<int>(y + tile))) &
                            cv::Rect(0, 0, picture.cols, picture.rows));
      const double kind = random.Uniform();
      if (kind < 0.1) {
        one.setTo(Grey(250));  // lamp
      } else if (kind < 0.17) {
        for (int row = 4; row + 3 < one.rows; row += 8) one.rowRange(row, row + 3).setTo(Grey(90));  // vent
      } else {
        for (int64_t i = random.UniformInt(0, 3); i > 0; --i) {  // stains, detectors
          const double value = 205 - random.Uniform(10, 90), radius = random.Uniform(0.01, 0.06) / texel_m;
          FillBlobSomewhere(one, radius, value, random);
        }
      }
      cv::rectangle(one, cv::Rect(0, 0, one.cols, one.rows), Grey(165), 1);
    }
  }
  return picture;
}

cv::Mat PaintTrim() { return cv::Mat(4, 4, CV_8UC1, Grey(120)); }

}  // namespace cairn::sim
