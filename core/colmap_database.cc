#include "core/colmap_database.h"
