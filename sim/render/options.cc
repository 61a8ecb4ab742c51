#include "sim/render/options.h"

namespace cairn::sim {

OptionTable DescribeOptions(SimulateOptions* o) {
  OptionTable table = {
      {"width_m", &o->width_m, "Inner width (x) of the building, metres", 4, 200},
      {"depth_m", &o->depth_m, "Inner depth (y) of the building, metres", 4, 200},
      {"height_m", &o->height_m, "Ceiling above the floor, metres", 2.2, 6},
      {"num_rooms", &o->num_rooms, "Rooms beside the corridors", 2, 1000},
      {"corridor_width_m", &o->corridor_width_m, "Width of corridors, metres", 1, 5},
      {"wall_thickness_m", &o->wall_thickness_m, "Thickness of walls, metres", 0.05, 0.5},
      {"door_width_m", &o->door_width_m, "Width of door openings, metres", 0.7, 3},
      {"door_height_m", &o->door_height_m, "Height of door openings, metres", 1.8, 6},
      {"extra_door_ratio", &o->extra_door_ratio, "Share of neighbouring rooms that are joined directly", 0,
       1},
      {"furniture_ratio", &o->furniture_ratio, "Share of a room's floor that furniture covers", 0, 0.6},
      {"pillars_per_room", &o->pillars_per_room, "Free-standing pillars per room", 0, 10},
      {"twin_wings", &o->twin_wings,
       "Two wings that look alike, a spine and a goal room instead of rooms along corridors"},
      {"back_corridor", &o->back_corridor,
       "Wings and goal room lead on to a second corridor: several ways to the goal"},
      {"panel_width_m", &o->panel_width_m, "Greatest width of a wall panel, metres", 0.5, 10},
      {"repetition_ratio", &o->repetition_ratio, "Share of wall panels with a texture of the shared set", 0,
       1},
      {"num_shared_textures", &o->num_shared_textures, "Textures in the shared set", 1, 100},
      {"num_different_panels", &o->num_different_panels,
       "Wall panels of the second of twin wings that differ from the first's", 0},
      {"change", &o->change,
       "What is otherwise than when the building was built; 0: nothing, another number: another choice of "
       "what",
       0},
      {"changed_panel_ratio", &o->changed_panel_ratio,
       "Share of wall panels that show something else after a change", 0, 1},
      {"removed_furniture_ratio", &o->removed_furniture_ratio,
       "Share of pieces of furniture that are gone after a change", 0, 1},
      {"moved_furniture_ratio", &o->moved_furniture_ratio,
       "Share of the pieces left that stand elsewhere in their rooms after a change, where there is a place",
       0, 1},
      {"moved_panel_ratio", &o->moved_panel_ratio,
       "Share of wall panels that exchange what they show with another of their width after a change", 0, 1},
      {"texel_m", &o->texel_m, "Edge of a wall texel, metres; floor and ceiling have twice that", 0.001,
       0.05},
      {.name = "camera_model",
       .value = &o->camera_model,
       .help = "Camera of the survey; panoramas (EQUIRECTANGULAR) have pinhole queries",
       .choices = {"PINHOLE", "OPENCV_FISHEYE", "EQUIRECTANGULAR"}},
      {"image_width_px", &o->image_width_px, "Image width, pixels", 32, 8192},
      {"image_height_px", &o->image_height_px, "Image height, pixels", 32, 8192},
      {"horizontal_fov_deg", &o->horizontal_fov_deg,
       "Horizontal field of view, degrees; of a pinhole at most 140", 20, 200},
      {"panorama_width_px", &o->panorama_width_px, "Width of panoramas, pixels; their height is half of it",
       64, 16384},
      {"camera_height_m", &o->camera_height_m, "Camera above the floor, metres", 0.1, 5},
      {.name = "survey",
       .value = &o->survey,
       .help = "Stations on a lattice with all headings, or images along a path through all rooms",
       .choices = {"lattice", "driven"}},
      {"spacing_m", &o->spacing_m, "Edge of the lattice, metres", 0.05, 10},
      {"num_headings", &o->num_headings, "Headings of a lattice station (Sala06: 4)", 1, 360},
      {"survey_area_m", &o->survey_area_m,
       "Part of the floor that a lattice survey and its queries are limited to: x from, y from, x to, y to, "
       "metres; empty: all"},
      {"step_m", &o->step_m, "Path length between images of a driven survey, metres", 0.01, 5},
      {"max_turn_deg", &o->max_turn_deg,
       "Greatest turn between images of a driven survey, degrees: where the way turns faster, the camera "
       "turns "
       "on the spot",
       0.1, 90},
      {"clearance_m", &o->clearance_m, "Least distance of the camera from walls and furniture, metres", 0.05,
       2},
      {"pose_noise_m", &o->pose_noise_m, "Standard deviation of stated survey positions, per axis, metres", 0,
       1},
      {"pose_noise_deg", &o->pose_noise_deg,
       "Standard deviation of stated survey rotations, per axis, degrees", 0, 45},
      {"run", &o->run, "Number of the run through the building: each has its own way and noise", 0},
      {"light_ratio", &o->light_ratio, "Brightness of all images before noise, as part of full light", 0.01,
       1},
      {"image_noise", &o->image_noise, "Standard deviation of grey noise in survey images, of 255", 0, 50},
      {"jpeg_quality", &o->jpeg_quality, "Quality of the JPEG files", 1, 100},
      {"readout_ratio", &o->readout_ratio,
       "Rolling shutter: part of the time from one image of a driven survey to the next in which it is read, "
       "row by row from the top",
       0, 1},
      {"rig_num_cameras", &o->rig_num_cameras,
       "Cameras of the rig that takes the queries and the images of a driven survey, evenly turned about an "
       "upright axis: camera k's images are in a folder camK",
       1, 16},
      {"rig_radius_m", &o->rig_radius_m, "Distance of a rig's cameras from its axis, metres", 0, 2},
      {"num_queries", &o->num_queries, "Held-out images at free poses", 0, 1000000},
      {.name = "query_headings",
       .value = &o->query_headings,
       .help = "Where queries of a lattice survey look: in any direction, or along one of its headings",
       .choices = {"any", "surveyed"}},
      {"query_tilt_deg", &o->query_tilt_deg, "Standard deviation of the queries' pitch and roll, degrees", 0,
       30},
      {"query_height_m", &o->query_height_m, "Standard deviation of the queries' camera height, metres", 0,
       0.3},
      {"query_noise", &o->query_noise, "Standard deviation of grey noise in queries, of 255", 0, 50},
      {"query_gain", &o->query_gain, "Queries' exposure gain is uniform in 1 +- this", 0, 0.9},
      {"query_bias", &o->query_bias, "Queries' exposure bias is uniform in +- this, of 255", 0, 100},
      {"query_blur_px", &o->query_blur_px, "Longest motion blur of queries, pixels", 0, 50},
  };
  AddCondition({"survey", {"lattice"}}, {"spacing_m", "num_headings", "survey_area_m", "query_headings"},
               &table);
  AddCondition({"survey", {"driven"}}, {"step_m", "max_turn_deg", "readout_ratio"}, &table);
  AddCondition({"camera_model", {"EQUIRECTANGULAR"}}, {"panorama_width_px"}, &table);
  AddCondition({"camera_model", {"PINHOLE", "OPENCV_FISHEYE"}}, {"num_headings"}, &table);
  AddCondition({"rig_num_cameras", {"not 1"}}, {"rig_radius_m"}, &table);
  AddCondition({"twin_wings", {"true"}}, {"back_corridor", "num_different_panels"}, &table);
  return table;
}

Status CheckSimulateOptions(const SimulateOptions& options) {
  SimulateOptions copy = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&copy)));
  if (options.camera_model != "OPENCV_FISHEYE" && options.horizontal_fov_deg > 140) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "option horizontal_fov_deg = {:g}: a pinhole camera sees at most 140; use "
                     "camera_model = OPENCV_FISHEYE",
                     options.horizontal_fov_deg);
  }
  const std::vector<double>& area = options.survey_area_m;
  if (!area.empty() && !(area.size() == 4 && area[0] < area[2] && area[1] < area[3])) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "option survey_area_m has {} numbers: expected x from, y from, x to, y to, each 'from' "
                     "below its 'to'",
                     area.size());
  }
  if (options.panorama_width_px % 2 != 0) {
    return MakeError(ErrorCode::kInvalidArgument, "option panorama_width_px = {}: must be even",
                     options.panorama_width_px);
  }
  if (options.door_height_m >= options.height_m) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "option door_height_m = {:g}: must be below the ceiling (height_m = {:g})",
                     options.door_height_m, options.height_m);
  }
  if (options.camera_height_m + 0.1 > options.height_m) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "option camera_height_m = {:g}: must be at least 0.1 m below the ceiling (height_m = {:g})",
        options.camera_height_m, options.height_m);
  }
  return Ok();
}

}  // namespace cairn::sim
