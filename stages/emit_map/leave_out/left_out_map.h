#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/capture/capture.h"
#include "core/structure/triangulate.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/choose/leave_out_images.h"
#include "stages/emit_map/emit_map.h"
#include "stages/emit_map/survey_files.h"

namespace cairn::emit_map {

// What a map was made of, and how.
struct WholeMap : SurveyData {
  MapRows rows;
  EmitMapOptions options;            // with the bits of its descriptors, where trials chose them
  TriangulateOptions triangulation;  // of its landmarks
  std::string matches_path;          // matches.db, for the features
};

// The map as it would be without some images of the survey: their observations are gone, and with them
// classes that the others do not place; positions (place_anew.h) and descriptors are those of the others;
// which landmarks are chosen is decided anew (LandmarkOrder), in proportion as many as the map has.  Not anew
// are the tree of words, poses and cameras, which landmarks were adjusted with, the number of landmarks, the
// bits of their descriptors, and what trials measured of fixes: the left-out images had a part in these.
// The poses of left-out images are the survey's own, with nothing to add (stated_pose_sigma_m is 0).
// Same result for any number of threads.  Errors: those of LeaveOutImages and EmitMap: NoData where no
// landmark is left.
Result<MapRows> MakeLeftOutMap(const WholeMap& whole, const LeftOutImages& which, int num_threads);

// The tried images, with their poses in the map as the capture would state them.
std::vector<CaptureImage> TriedImages(const Classes& classes, const LeftOutImages& which);

}  // namespace cairn::emit_map
