#pragma once

#include <string>

#include "core/base/error.h"
#include "core/line/command.h"
#include "pipeline/commands/query_images.h"
#include "runtime/atlas/atlas_localizer.h"
#include "runtime/drive/route.h"
#include "runtime/localize/localizer_options.h"

namespace cairn::pipeline {

// What commands that are asked about a map do with an atlas of many.

// `cairn localize ATLAS IMAGE...`: JSON lines; each with the most probable place first.
Status LocalizeInAtlas(const std::string& path, const CameraChoice& cameras,
                       const LocalizerOptions& localizer_options, const AtlasLocalizerOptions& options,
                       ImageNames* names, const CommandEnvironment& environment);

// `cairn route ATLAS MAP/IMAGE MAP/IMAGE`
Status RouteInAtlas(const std::string& path, const std::string& from, const std::string& to,
                    const RouteOptions& options, bool json, const CommandEnvironment& environment);

// `cairn inspect ATLAS`
Status InspectAtlas(const std::string& path, bool json, const CommandEnvironment& environment);

}  // namespace cairn::pipeline
