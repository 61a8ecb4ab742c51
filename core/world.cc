#include "core/world.h"
