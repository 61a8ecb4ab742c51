#pragma once

#include <string>
#include <vector>

#include "core/options/options.h"

namespace cairn::sim {

// The building, its survey, and the effects of the camera.  The defaults are the demo: about 130 stations
// with four headings each in four furnished rooms along a corridor, and 93 held-out queries.
struct SimulateOptions {
  // --- The building: a box of width_m (x) by depth_m (y) inside its outer walls, floor at z = 0.
  // REQUIRES: in [4, 200] and [4, 200]
  double width_m = 9.5;
  double depth_m = 7.5;
  // Ceiling above the floor.  REQUIRES: in [2.2, 6]
  double height_m = 2.6;
  // Rooms beside the corridors.  REQUIRES: in [2, 1000], and not more than fit with 2 m each
  int num_rooms = 4;
  // REQUIRES: in [1, 5]
  double corridor_width_m = 1.7;
  // REQUIRES: in [0.05, 0.5]
  double wall_thickness_m = 0.15;
  // Openings without leaves.  REQUIRES: width in [0.7, 3], height in [1.8, 6] and below the ceiling
  double door_width_m = 1.2;
  double door_height_m = 2.1;
  // Share of neighbouring rooms that are also joined directly, which closes loops.  REQUIRES: in [0, 1]
  double extra_door_ratio = 0.4;
  // Share of a room's floor that furniture covers, as far as it fits without cutting the room in two.
  // REQUIRES: in [0, 0.6]
  double furniture_ratio = 0.12;
  // Pillars per room, free-standing where there is space.  REQUIRES: in [0, 10]
  double pillars_per_room = 0.5;

  // Two wings that look alike, a spine and a goal room instead of rooms along corridors: perceptual aliasing
  // of whole places (twin_wings.h).
  bool twin_wings = false;
  // The wings lead on to a second corridor, to which the goal room opens as well: ways that look alike, and
  // one that does not.  Used with twin_wings only.
  bool back_corridor = false;

  // --- Its surfaces
  // Walls are covered with panels of at most this width, each with a texture.  REQUIRES: in [0.5, 10]
  double panel_width_m = 1.6;
  // Share of wall panels that take their texture from a small shared set: perceptual aliasing.
  // REQUIRES: in [0, 1]
  double repetition_ratio = 0.15;
  // Size of that set.  REQUIRES: in [1, 100]
  int num_shared_textures = 3;
  // Wall panels of the second of twin wings that differ from the first's, those near its middle first.
  // REQUIRES: >= 0
  int num_different_panels = 1;
  // What is otherwise than when the building was built: places change between surveys.  0: nothing; another
  // number: another choice of what.  REQUIRES: >= 0
  int change = 0;
  // Share of wall panels that show something else then, and of pieces of furniture that were taken away.
  // REQUIRES: in [0, 1]
  double changed_panel_ratio = 0.3;
  double removed_furniture_ratio = 0;
  // Share of the pieces that are left which stand elsewhere in their rooms then, where there is a place.
  // REQUIRES: in [0, 1]
  double moved_furniture_ratio = 0;
  // Share of wall panels that exchange what they show with another then: things that were moved.
  // REQUIRES: in [0, 1]
  double moved_panel_ratio = 0;
  // Edge of a wall texel; floor and ceiling have twice that.  REQUIRES: in [0.001, 0.05]
  double texel_m = 0.003;

  // --- The camera.  PINHOLE: an ideal one.  OPENCV_FISHEYE: a fisheye lens with some distortion.
  // EQUIRECTANGULAR: panoramas for the survey (one per station; num_headings is not used), pinhole queries.
  std::string camera_model = "PINHOLE";
  // REQUIRES: in [32, 8192]
  int image_width_px = 640;
  int image_height_px = 480;
  // REQUIRES: in [20, 200]; of a pinhole at most 140
  double horizontal_fov_deg = 90;
  // Width of panoramas; their height is half of it.  REQUIRES: in [64, 16384], even
  int panorama_width_px = 2048;
  // Height of the camera above the floor.  REQUIRES: in [0.1, 5], below the ceiling
  double camera_height_m = 1.0;

  // --- The survey
  // "lattice": stations on a square lattice with num_headings images each; "driven": images along a path
  // through all rooms, looking ahead.
  std::string survey = "lattice";
  // Edge of the lattice.  REQUIRES: in [0.05, 10]
  double spacing_m = 0.5;
  // Headings of a lattice station, evenly spread from +x [Sala06: 4].  REQUIRES: in [1, 360]
  int num_headings = 4;
  // The part of the floor that a lattice survey covers and its queries lie in: x from, y from, x to, y to, m;
  // empty: all of it.
  std::vector<double> survey_area_m;
  // Path length between two images of a driven survey.  REQUIRES: in [0.01, 5]
  double step_m = 0.15;
  // Greatest turn between two images of a driven survey: where the way turns faster, the camera turns on the
  // spot.  With steps of 3 cm and turns of 2 degrees the images are those of a film.  REQUIRES: in [0.1, 90]
  double max_turn_deg = 25;
  // Number of the run through the same building; each has other places in another order, and other noise.
  // For a second survey of it, or a drive to localize along.  REQUIRES: >= 0
  int run = 0;
  // Least distance of the camera from walls and furniture.  REQUIRES: in [0.05, 2]
  double clearance_m = 0.3;
  // Standard deviation of the poses in images.txt from the true ones: per axis of position and of rotation.
  // REQUIRES: in [0, 1] and [0, 45]
  double pose_noise_m = 0;
  double pose_noise_deg = 0;
  // Standard deviation of the grey noise of survey images, of 255.  REQUIRES: in [0, 50]
  double image_noise = 1.0;
  // Brightness of all images before noise, as part of full light: with less light, noise and rounding to grey
  // values matter more.  REQUIRES: in [0.01, 1]
  double light_ratio = 1;
  // Of all image files.  REQUIRES: in [1, 100]
  int jpeg_quality = 95;
  // Part of the time from one image of a driven survey to the next in which it is read, row by row from the
  // top: a rolling shutter.  REQUIRES: in [0, 1]
  double readout_ratio = 0;
  // Cameras of the rig that takes the queries and the images of a driven survey, evenly turned about an
  // upright axis, rig_radius_m from it; the first looks ahead.  REQUIRES: in [1, 16] and [0, 2]
  int rig_num_cameras = 1;
  double rig_radius_m = 0.1;

  // --- The queries: free poses off the lattice, held out
  // REQUIRES: in [0, 1000000]
  int num_queries = 93;
  // Where queries of a lattice survey look: in "any" direction, or "surveyed": along one of its headings.
  std::string query_headings = "any";
  // Standard deviations of pitch and roll, and of the height around camera_height_m.
  // REQUIRES: in [0, 30] and [0, 0.3]
  double query_tilt_deg = 2;
  double query_height_m = 0.03;
  // Grey noise as above.  REQUIRES: in [0, 50]
  double query_noise = 2.0;
  // Exposure: gain uniform in 1 +- query_gain, bias uniform in +- query_bias (of 255).
  // REQUIRES: in [0, 0.9] and [0, 100]
  double query_gain = 0.25;
  double query_bias = 12;
  // Largest motion blur: the camera turns during the exposure so far that the middle of the image moves by a
  // length uniform in [0, query_blur_px].  REQUIRES: in [0, 50]
  double query_blur_px = 3;
};
OptionTable DescribeOptions(SimulateOptions* options);

// Checks ranges and combinations of options.  Errors: InvalidArgument.
Status CheckSimulateOptions(const SimulateOptions& options);

}  // namespace cairn::sim
