// The C API's survey images, ways between them, and place models (runtime/c_api/cairn.h).
#include "runtime/c_api/places.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/features/sift.h"
#include "runtime/c_api/structs.h"
#include "runtime/drive/route.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"

namespace cairn {
namespace {

Status CheckRoom(const PlaceModel& model, const cairn_place_scores* places) {
  CAIRN_RETURN_IF_ERROR(CheckStruct(places, "places"));
  if (places->num_places == model.num_nodes()) return Ok();
  return Misuse("places->num_places is {}, but the map has {}", places->num_places, model.num_nodes());
}

void Fill(const PlaceScores& found, cairn_place_scores* places) {
  if (places->scores != nullptr) std::copy(found.scores.begin(), found.scores.end(), places->scores);
  if (places->probabilities != nullptr)
    std::copy(found.probabilities.begin(), found.probabilities.end(), places->probabilities);
}

Status CheckPlace(const PlaceModel& model, int32_t place) {
  if (place >= 0 && place < model.num_nodes()) return Ok();
  return Misuse("place {} of {}", place, model.num_nodes());
}

// Runs `look` on a model, whose PlaceScores it gives to the caller.
template <typename Look>
int32_t CallLook(const char* function, cairn_place_model* model, cairn_place_scores* places, Look&& look) {
  return Call(function, [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlaceModel>::Begin(OpenPlaceModels(), model));
    CAIRN_RETURN_IF_ERROR(CheckRoom(*used->model, places));
    CAIRN_ASSIGN_OR_RETURN(const PlaceScores found, look(used));
    Fill(found, places);
    return Ok();
  });
}

}  // namespace

Status OpenPlaceModel::Begin(const LookOptions& given) {
  // Its words are many: they are not read again for options of features.
  if (!model || given.model.score_exponent != options.model.score_exponent) {
    CAIRN_ASSIGN_OR_RETURN(model, PlaceModel::Make(*map, given.model));
  }
  options = given;
  return Ok();
}

Handles<cairn_place_model, OpenPlaceModel, HandleKind::kPlaceModel>& OpenPlaceModels() {
  static auto* models = new Handles<cairn_place_model, OpenPlaceModel, HandleKind::kPlaceModel>;
  return *models;
}

Status ReturnNumbers(const std::vector<int32_t>& numbers, const char* what, int32_t* to, int32_t capacity,
                     int32_t* num_numbers) {
  if (num_numbers == nullptr) return Misuse("num_{} is NULL", what);
  if (capacity < 0) return Misuse("capacity is {}; must not be negative", capacity);
  if (to == nullptr && capacity > 0) return Misuse("{} is NULL, with a capacity of {}", what, capacity);
  *num_numbers = static_cast<int32_t>(numbers.size());
  std::copy_n(numbers.begin(), std::min(numbers.size(), static_cast<size_t>(capacity)), to);
  return Ok();
}

}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

int32_t cairn_map_find_image(const cairn_map* map, const char* name, int32_t* image) {
  return Call("cairn_map_find_image", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> open, FindMap(map));
    if (name == nullptr || image == nullptr) return Misuse("{} is NULL", name == nullptr ? "name" : "image");
    CAIRN_ASSIGN_OR_RETURN(*image, FindImage(*open, name));
    return Ok();
  });
}

int32_t cairn_map_describe_image(const cairn_map* map, int32_t image, cairn_survey_image* description) {
  return Call("cairn_map_describe_image", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> open, FindMap(map));
    CAIRN_RETURN_IF_ERROR(CheckStruct(description, "description"));
    CAIRN_ASSIGN_OR_RETURN(const Pose pose, PoseOfImage(*open, image));
    CAIRN_ASSIGN_OR_RETURN(const std::string name, open->ImageName(image));
    Return(SurveyImageFrom(name, pose), description);
    return Ok();
  });
}

int32_t cairn_route(const cairn_map* map, int32_t from, int32_t to, const char* weight, int32_t* images,
                    int32_t capacity, int32_t* num_images, double* cost) {
  if (num_images != nullptr) *num_images = 0;
  return Call("cairn_route", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> open, FindMap(map));
    RouteOptions options;
    if (weight != nullptr) options.weight = weight;
    CAIRN_ASSIGN_OR_RETURN(const Route route, PlanRoute(*open, from, to, options));
    CAIRN_RETURN_IF_ERROR(ReturnNumbers(route.images, "images", images, capacity, num_images));
    if (cost != nullptr) *cost = route.cost;
    return Ok();
  });
}

int32_t cairn_place_model_create(const cairn_map* map, cairn_place_model** model) {
  if (model != nullptr) *model = nullptr;
  return Call("cairn_place_model_create", [&]() -> Status {
    if (model == nullptr) return Misuse("model is NULL: there is no place for the handle");
    auto created = std::make_shared<OpenPlaceModel>();
    CAIRN_ASSIGN_OR_RETURN(created->map, FindMap(map));
    CAIRN_RETURN_IF_ERROR(created->Begin({}));
    *model = OpenPlaceModels().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_place_model_set_option(cairn_place_model* model, const char* name, const char* value) {
  return Call("cairn_place_model_set_option", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlaceModel>::Begin(OpenPlaceModels(), model));
    LookOptions options = used->options;
    CAIRN_RETURN_IF_ERROR(SetOptionByName(DescribeOptions(&options), name, value, kLookOptionsHelp));
    return used->Begin(options);
  });
}

int32_t cairn_place_model_num_places(const cairn_place_model* model, int32_t* num_places) {
  return Call("cairn_place_model_num_places", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlaceModel>::Begin(OpenPlaceModels(), model));
    if (num_places == nullptr) return Misuse("num_places is NULL");
    *num_places = used->model->num_nodes();
    return Ok();
  });
}

int32_t cairn_place_model_place_of_image(const cairn_place_model* model, int32_t image, int32_t* place) {
  return Call("cairn_place_model_place_of_image", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlaceModel>::Begin(OpenPlaceModels(), model));
    if (place == nullptr) return Misuse("place is NULL");
    if (image < 0 || image >= used->map->num_images())
      return Misuse("image {} of {}", image, used->map->num_images());
    *place = used->model->NodeOfImage(image);
    return Ok();
  });
}

int32_t cairn_place_model_image_of_place(const cairn_place_model* model, int32_t place, int32_t* image) {
  return Call("cairn_place_model_image_of_place", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlaceModel>::Begin(OpenPlaceModels(), model));
    if (image == nullptr) return Misuse("image is NULL");
    CAIRN_RETURN_IF_ERROR(CheckPlace(*used->model, place));
    *image = used->model->ImagesOfNode(place).front();
    return Ok();
  });
}

int32_t cairn_place_model_look(cairn_place_model* model, const cairn_image* image,
                               cairn_place_scores* places) {
  return CallLook("cairn_place_model_look", model, places,
                  [&](const Use<OpenPlaceModel>& used) -> Result<PlaceScores> {
                    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
                    CAIRN_ASSIGN_OR_RETURN(const Features features, ExtractSift(grey, used->options.sift));
                    return used->model->Look(features.descriptors);
                  });
}

int32_t cairn_place_model_look_at_features(cairn_place_model* model, const uint8_t* descriptors,
                                           int32_t num_features, cairn_place_scores* places) {
  return CallLook("cairn_place_model_look_at_features", model, places,
                  [&](const Use<OpenPlaceModel>& used) -> Result<PlaceScores> {
                    if (num_features < 0)
                      return Misuse("num_features is {}; must not be negative", num_features);
                    if (descriptors == nullptr && num_features > 0) return Misuse("descriptors is NULL");
                    DescriptorMatrix rows(num_features, kSiftDescriptorDim);
                    std::copy_n(descriptors, rows.size(), rows.data());
                    return used->model->Look(rows);
                  });
}

int32_t cairn_place_model_look_closer(cairn_place_model* model, const cairn_image* image,
                                      const cairn_camera* camera, cairn_place_scores* places) {
  return CallLook("cairn_place_model_look_closer", model, places,
                  [&](const Use<OpenPlaceModel>& used) -> Result<PlaceScores> {
                    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
                    CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
                    const Localizer localizer(used->map, {.sift = used->options.sift});
                    CAIRN_ASSIGN_OR_RETURN(const Query query, localizer.QueryFromImage(grey, chosen));
                    return used->model->LookCloser(*used->map, query, used->options.closer);
                  });
}

int32_t cairn_place_model_expected(cairn_place_model* model, int32_t place, double* probabilities,
                                   int32_t num_places) {
  return Call("cairn_place_model_expected", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlaceModel>::Begin(OpenPlaceModels(), model));
    CAIRN_RETURN_IF_ERROR(CheckPlace(*used->model, place));
    if (probabilities == nullptr) return Misuse("probabilities is NULL");
    if (num_places != used->model->num_nodes())
      return Misuse("num_places is {}, but the map has {}", num_places, used->model->num_nodes());
    const std::vector<double> expected = used->model->Expected(place);
    std::copy(expected.begin(), expected.end(), probabilities);
    return Ok();
  });
}

int32_t cairn_place_model_destroy(cairn_place_model* model) {
  return Call("cairn_place_model_destroy", [&] { return DestroyObject(OpenPlaceModels(), model); });
}
