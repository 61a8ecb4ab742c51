#include "core/descriptor_matcher.h"
