#include "core/feature_class.h"
