#pragma once

#include <string>

#include "core/base/error.h"
#include "stages/decompose_views/formats/input_plan.h"
#include "stages/decompose_views/formats/plan_units.h"

namespace cairn::decompose_views {

struct DxfOptions {
  // Of PlanUnits(); kUnitOfFile: the file's $INSUNITS, metres where it has none.
  std::string units = kUnitOfFile;
  // The layers whose entities are walls, between commas, `*` and `?` as in names of files, in any case;
  // empty: all that are neither off nor frozen.
  std::string layers;
  // How far a chord of an arc may lie beside it, metres.  REQUIRES: in [0.0001, 10]
  double curve_tolerance_m = 0.01;
};

// A plan and what its numbers were taken for.
struct DxfPlan {
  InputPlan plan;  // metres
  UnitClaim claim;
};

// Whether a text begins as DXF does, in its ASCII form.
bool LooksLikeDxf(const std::string& text);

// Reads the walls of a drawing's model space, ASCII DXF of any version: LINE, LWPOLYLINE and POLYLINE (with
// bulges), ARC, CIRCLE, and INSERT of blocks that have them, in each other too; curves become chords.
// Entities of layer 0 in a block are on the layer of its INSERT.  The plan's notes say how many walls each
// layer has, and what other entities were left out.  `what` names the text. Errors, with the line: Corrupt
// (no number, NaN, no EOF, a block that is not there or inserts itself), Unsupported (a unit that is none of
// PlanUnits(), more walls than are divided, or 2,000,000 entities with those of inserted blocks), NoData (no
// walls, or none on these layers: says which there are).
Result<DxfPlan> ParseDxf(const std::string& text, const std::string& what, const DxfOptions& options);

}  // namespace cairn::decompose_views
