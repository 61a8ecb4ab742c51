#include "core/sift.h"
