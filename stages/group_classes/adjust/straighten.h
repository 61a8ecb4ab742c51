#pragma once

#include <vector>

#include "core/structure/triangulate.h"
#include "stages/group_classes/adjust/adjust_survey.h"
#include "stages/group_classes/adjust/survey_adjuster.h"
#include "stages/group_classes/tracks/posed_images.h"

namespace cairn::group_classes {

// Adjusts a survey's poses, and its cameras and offset, by what was learnt of them (adjust_survey.h):
// together, a large survey in parts before that (parts.h), a very large one block by block (blocks.h).  Poses
// that are exact stay what they are.  `first`: how tracks are triangulated by poses as stated.
void StraightenSurvey(const AdjustContext& context, const std::vector<Track>& tracks,
                      const TriangulateOptions& first, const SurveyFindings& findings, PosedImages* posed);

}  // namespace cairn::group_classes
