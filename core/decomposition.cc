#include "core/decomposition.h"
