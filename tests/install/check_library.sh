#!/bin/sh
# What the shared library links and exports:  check_library.sh LIBRARY C_SYMBOLS C_HEADER
set -eu
library=$1 c_symbols=$2 c_header=$3

needed=$(readelf -d "$library" | sed -n 's/.*NEEDED.*\[\(.*\)\]/\1/p')
for unwanted in colmap ceres geos glpk CBC Cbc imgcodecs tomlplusplus spdlog yaml CLI exif; do
  if ldd "$library" | grep -i "lib[a-z_]*$unwanted"; then
    echo "$library pulls in $unwanted, which robots do not need" >&2
    exit 1
  fi
done
if [ "$(echo "$needed" | grep -c opencv)" -gt 4 ]; then
  echo "$library links more of OpenCV than core, imgproc, features2d and calib3d: $needed" >&2
  exit 1
fi

# The C API is there, all of it under its version, and nothing beside it and namespace cairn.
declared=$(sed -n 's/^ *\(cairn_[a-z_]*\);$/\1@@CAIRN_0/p' "$c_symbols" | sort)
exported=$(nm -D --defined-only "$library" | awk '{print $3}' | grep '^cairn_' | sort)
if [ "$declared" != "$exported" ]; then
  echo "the C API is not what $c_symbols lists; exported: $exported" >&2
  exit 1
fi
in_header=$(grep -oE '\bcairn_[a-z_]+\(' "$c_header" | sed 's/($/@@CAIRN_0/' | sort -u)
if [ "$in_header" != "$exported" ]; then
  echo "the C API is not what $c_header declares; exported: $exported" >&2
  exit 1
fi
foreign=$(nm -D --defined-only "$library" | awk '$2 != "A" {print $3}' | grep -v '^cairn_' |
  grep -vE '^_ZN?K?(T[IVS]N?)?5cairn' || true)
if [ -n "$foreign" ]; then
  echo "$library exports what is not its own: $foreign" >&2
  exit 1
fi
for name in 'cairn::Map::Open(' 'cairn::Localizer::Localize(' 'cairn::RegionTracker::Track(' 'cairn::EstimateVisualPose(' 'cairn::VisualTracker::See(' \
    'cairn::PlaceModel::Make(' 'cairn::PlaceModel::LookCloser(' 'cairn::StartHypotheses::Observe(' 'cairn::PlaceBelief::See(' 'cairn::PlanRoute(' \
    'cairn::Atlas::Open(' 'cairn::AtlasLocalizer::Localize(' 'cairn::OpenPlan(' 'cairn::ScanLocator::Locate(' 'cairn::RobotOnPlan::SeeScan('; do
  nm -D --defined-only -C "$library" | grep -qF "$name" || { echo "$library does not export $name" >&2; exit 1; }
done
echo "$library: $(stat -Lc %s "$library") bytes; links" $needed
