/* Scans and odometry from a file of lines "AHEAD_M LEFT_M TURN_LEFT_RAD RANGE_M...", whose ranges go around
 * from behind, counter-clockwise; a robot takes its laser's and its wheels' instead. */
#ifndef SCANS_H_
#define SCANS_H_

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST_BEAMS 4000

/* The next line: `motion` of three numbers, and how many ranges; 0 at the end. */
static int ReadScan(FILE* file, double* motion, double* ranges_m) {
  static char line[MOST_BEAMS * 30];
  int num = 0;
  while (num < 4) {
    char* at = line;
    num = 0;
    if (fgets(line, sizeof line, file) == NULL) return 0;
    if (line[0] == '#') continue;
    while (num < MOST_BEAMS + 3) {
      char* end = at;
      const double number = strtod(at, &end);
      if (end == at) break;
      if (num < 3) {
        motion[num] = number;
      } else {
        ranges_m[num - 3] = number;
      }
      ++num;
      at = end;
    }
  }
  return num - 3;
}

#endif /* SCANS_H_ */
