#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "stages/reconstruct/verdict/verdict.h"

namespace cairn::pipeline {

// Whether a map was made of that reconstruction, as far as its images' names tell.
bool IsReconstructionOf(const reconstruct::Verdict& verdict, const MapRows& rows);

// What the page's tables show of a reconstruction: how it is, its loops, where it is weak, and what is
// missing; of long lists what matters most.
nlohmann::ordered_json ReconstructionJson(const reconstruct::Verdict& verdict);

// The same for paper: sentences, and the missing images with their reasons.
std::string ReconstructionText(const reconstruct::Verdict& verdict);

}  // namespace cairn::pipeline
