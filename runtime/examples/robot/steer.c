/* How does a robot get to where the survey image TARGET was taken?  The command after each of these pictures,
 * one every quarter of a second.  steer_c MAP TARGET PICTURE.pgm... */
#include <stdio.h>
#include <stdlib.h>

#include "pgm.h"
#include "runtime/c_api/cairn.h"

/* Ends the program after an error. */
static void Check(int code) {
  if (code == CAIRN_OK) return;
  fprintf(stderr, "%s\n", cairn_last_error());
  exit(code);
}

int main(int argc, char** argv) {
  if (argc < 4) return fprintf(stderr, "usage: steer_c MAP TARGET PICTURE.pgm... (8-bit grey)\n"), 2;

  cairn_map* map = NULL;
  cairn_servo* servo = NULL;
  cairn_servo_command command = CAIRN_SERVO_COMMAND_INIT;
  int32_t target = 0;
  Check(cairn_map_open(argv[1], NULL, &map)); /* shared by all threads */
  Check(cairn_map_find_image(map, argv[2], &target));
  Check(cairn_servo_create(map, target, &servo)); /* one for each image of a way */
  for (int i = 3; i < argc && command.state != CAIRN_SERVO_ARRIVED; ++i) {
    cairn_image image = CAIRN_IMAGE_INIT;
    uint8_t* pixels = ReadPgm(argv[i], &image.width, &image.height);
    image.pixels = pixels;
    Check(cairn_servo_step(servo, &image, NULL, &command));
    free(pixels);
    /* drive like this, for command.step_s or until the next image */
    printf("%s %.17g m/s %.17g rad/s, %d matches\n", cairn_servo_state_name(command.state), command.speed_m_s,
           command.turn_rad_s, (int)command.num_matches);
  }

  cairn_servo_destroy(servo);
  cairn_map_close(map);
  return 0;
}
