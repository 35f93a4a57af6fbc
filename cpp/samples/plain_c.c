/* The C interface: two small frames of a disc before a prior of a sphere that may grow along z.
 * Shows errors, a linear prior from arrays, options, an observer and what a solution holds. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "spba/spba.h"

enum { WIDTH = 96, HEIGHT = 72, POINTS = 600, FRAMES = 2 };

static int check(spba_code code, const char* what) {
  if (code != SPBA_OK) fprintf(stderr, "%s: code %d: %s\n", what, (int)code, spba_error_message());
  return code == SPBA_OK;
}

/* A sphere of diameter 1 / sqrt(3), so that its box has a diagonal of 1; the one style stretches it by a
 * tenth. */
static int make_prior(spba_prior** prior) {
  static double mean[3 * POINTS], basis[3 * POINTS], normals[3 * POINTS];
  const double radius = 0.5 / sqrt(3.0);
  for (int i = 0; i < POINTS; ++i) {
    /* A bit-reversed index puts an even sample into any first part. */
    unsigned bits = (unsigned)i, reversed = 0;
    for (int b = 0; b < 10; ++b, bits >>= 1) reversed = reversed << 1 | (bits & 1u);
    const double height = 1.0 - 2.0 * (reversed + 0.5) / 1024.0, around = 2.399963229728653 * (double)i;
    const double flat = sqrt(1.0 - height * height);
    normals[3 * i] = flat * cos(around);
    normals[3 * i + 1] = height;
    normals[3 * i + 2] = flat * sin(around);
    for (int k = 0; k < 3; ++k) mean[3 * i + k] = radius * normals[3 * i + k];
    basis[3 * i + 2] = 0.1 * mean[3 * i + 2];
  }
  spba_linear_prior arrays = {0};
  arrays.struct_size = sizeof arrays;
  arrays.point_count = POINTS;
  arrays.style_count = 1;
  arrays.mean = mean;
  arrays.basis = basis;
  arrays.normals = normals;
  return check(spba_prior_linear(&arrays, prior), "spba_prior_linear");
}

static int add_frame(spba_sequence* sequence, int index) {
  static unsigned char rgb[3 * WIDTH * HEIGHT], grey[WIDTH * HEIGHT];
  for (int y = 0; y < HEIGHT; ++y) {
    for (int x = 0; x < WIDTH; ++x) {
      const double dx = x + 0.5 - 48.0 - 2.0 * index, dy = y + 0.5 - 36.0;
      const int at = y * WIDTH + x;
      grey[at] = dx * dx + dy * dy < 15.0 * 15.0 ? 255 : 0;
      for (int c = 0; c < 3; ++c) {
        rgb[3 * at + c] = (unsigned char)(grey[at] ? 128.0 + 60.0 * sin(0.5 * dx + c) * cos(0.4 * dy) : 30.0);
      }
    }
  }
  spba_raster image = {0}, mask = {0};
  image.struct_size = mask.struct_size = sizeof image;
  image.width = mask.width = WIDTH;
  image.height = mask.height = HEIGHT;
  image.format = SPBA_RGB_U8;
  image.row_stride = 3 * WIDTH;
  image.data = rgb;
  mask.format = SPBA_GREY_U8;
  mask.row_stride = WIDTH;
  mask.data = grey;
  spba_frame frame = {0};
  frame.struct_size = sizeof frame;
  frame.name = index == 0 ? "left" : "right";
  frame.image = &image;
  frame.mask = &mask;
  frame.fx = frame.fy = 100.0;
  frame.cx = 48.0;
  frame.cy = 36.0;
  return check(spba_sequence_add_frame(sequence, &frame), "spba_sequence_add_frame");
}

static int32_t count_calls(void* user, const spba_progress* progress) {
  (void)progress;
  ++*(int*)user;
  return 1;
}

int main(void) {
  spba_prior* prior = NULL;
  spba_sequence* sequence = NULL;
  spba_options* options = NULL;
  spba_solution* solution = NULL;
  int calls = 0, status = EXIT_FAILURE;
  spba_callbacks callbacks = {0};
  callbacks.struct_size = sizeof callbacks;
  callbacks.observer = count_calls;
  callbacks.observer_user = &calls;

  printf("spba %s\n", spba_version());
  if (!make_prior(&prior) || !check(spba_sequence_new(&sequence), "spba_sequence_new")) goto end;
  for (int i = 0; i < FRAMES; ++i) {
    if (!add_frame(sequence, i)) goto end;
  }
  if (!check(spba_options_from_toml("threads = 1\n[solver]\nlevels = 1\n[init.hypotheses]\ncount = 1\n",
                                    &options),
             "spba_options_from_toml") ||
      !check(spba_solve(sequence, prior, options, &callbacks, &solution), "spba_solve")) {
    goto end;
  }
  spba_summary summary = {0};
  summary.struct_size = sizeof summary;
  if (!check(spba_solution_summary(solution, &summary), "spba_solution_summary")) goto end;
  for (uint32_t i = 0; i < summary.frame_count; ++i) {
    spba_pose pose;
    double iou = 0.0;
    if (!check(spba_solution_cam_from_object(solution, i, &pose), "cam_from_object") ||
        !check(spba_solution_silhouette_iou(solution, i, &iou), "silhouette_iou")) {
      goto end;
    }
    printf("frame %u: %.3f diagonals away, silhouette IoU %.3f\n", (unsigned)i, pose.translation[2], iou);
  }
  spba_similarity similarity;
  if (spba_solution_object_from_world(solution, &similarity) != SPBA_NOT_THERE) {
    fprintf(stderr, "there were no poses\n");
    goto end;
  }
  printf("%u points, %u faces, style %.3f, %s observer calls\n", (unsigned)summary.point_count,
         (unsigned)summary.face_count, spba_solution_style(solution)[0], calls > 0 ? "with" : "without");
  status = calls > 0 ? EXIT_SUCCESS : EXIT_FAILURE;

end:
  spba_solution_free(solution);
  spba_options_free(options);
  spba_sequence_free(sequence);
  spba_prior_free(prior);
  return status;
}
