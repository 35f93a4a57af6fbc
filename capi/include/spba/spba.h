/* The C interface of libspba: from pictures, masks, intrinsics and a shape prior to an object's shape and the
 * camera of every frame. C11, and C++ alike; spba.hpp is the same in C++17.
 *
 * Conventions
 *  - A function returns a spba_code. Where it is not SPBA_OK, spba_error_message() says what is wrong and how
 *    to mend it, in one line, until the next call on the same thread. No exception or panic leaves a
 * function.
 *  - Every struct that a function reads or fills starts with its size, which the caller sets to sizeof.
 *  - Handles are freed with their _free function, which takes NULL too. A handle is used from one thread at a
 *    time; a spba_prior, spba_options or spba_solution that nothing changes, from any number of threads.
 *  - Text is UTF-8 and ends with a zero.
 *  - Object frame: +Y up, -Z front, the body's box is centred at the origin and has a diagonal of 1.
 *  - Camera frame: x right, y down, z forward, as in COLMAP and OpenCV. The centre of the top-left pixel is
 *    (0.5, 0.5), as in COLMAP.
 *  - A pose b_from_a is x_b = R x_a + t. cam_from_world is COLMAP's convention, in the host's units. */
#ifndef SPBA_SPBA_H_
#define SPBA_SPBA_H_

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define SPBA_API __attribute__((visibility("default")))
#else
#define SPBA_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Errors ---- */

typedef int32_t spba_code;
enum {
  SPBA_OK = 0,
  SPBA_INVALID_INPUT = 1,   /* a frame, or an argument */
  SPBA_INVALID_PRIOR = 2,   /* a file or arrays that are no shape prior */
  SPBA_INVALID_OPTIONS = 3, /* an unknown key, or a value out of range */
  SPBA_INTERRUPTED = 4,     /* the observer stopped the solve before there was any solution */
  SPBA_NO_SOLUTION = 5,     /* nothing fits, or the objective cannot be evaluated */
  SPBA_NOT_THERE = 6,       /* what is asked for is not there, such as a Sim3 without poses */
  SPBA_INTERNAL = 7         /* a fault of this library */
};

/* What the last call on this thread that failed says; empty before the first. */
SPBA_API const char* spba_error_message(void);
/* The library's version, such as "0.1.0". */
SPBA_API const char* spba_version(void);

/* ---- Frames ---- */

typedef uint32_t spba_format;
enum {
  SPBA_RGB_U8 = 0,  /* interleaved, 0 to 255 */
  SPBA_BGR_U8 = 1,  /* as OpenCV has it */
  SPBA_RGB_F32 = 2, /* interleaved, 0 to 255 */
  SPBA_GREY_U8 = 3, /* one channel */
  SPBA_GREY_F32 = 4 /* one channel */
};

/* A view of a picture, a mask or a depth map, row by row from the top. */
typedef struct spba_raster {
  uint32_t struct_size;
  spba_format format;
  uint32_t width;
  uint32_t height;
  size_t row_stride; /* bytes from one row to the next */
  const void* data;
} spba_raster;

typedef struct spba_pose {
  double quaternion_wxyz[4]; /* of unit length, the real part first */
  double translation[3];
} spba_pose;

typedef struct spba_frame {
  uint32_t struct_size;
  const char* name;         /* each once; NULL: the frame's index */
  const spba_raster* image; /* RGB or BGR, undistorted */
  const spba_raster* mask;  /* of the image's size; the object is above 127 (u8) or above 0.5 (f32) */
  const spba_raster* depth; /* f32, of the image's size: z in the poses' units, 0 = unknown. NULL: none */
  const spba_pose* cam_from_world; /* NULL: unknown */
  double fx, fy, cx, cy;           /* pixels */
} spba_frame;

typedef struct spba_sequence spba_sequence;

SPBA_API spba_code spba_sequence_new(spba_sequence** sequence);
/* Copies the frame. Refuses, by the frame's name: no image or mask, formats that do not fit, a mask without
 * object, a quaternion that is none. What frames must be together is checked by spba_solve. */
SPBA_API spba_code spba_sequence_add_frame(spba_sequence* sequence, const spba_frame* frame);
SPBA_API void spba_sequence_free(spba_sequence* sequence);

/* ---- Shape prior ---- */

typedef struct spba_prior spba_prior;

/* A linear prior from arrays: X(s) = mean + basis s, s standard normal. Any first part of the points is an
 * even sample of the surface (farthest-point order). */
typedef struct spba_linear_prior {
  uint32_t struct_size;
  uint32_t point_count;  /* N */
  uint32_t style_count;  /* S */
  const double* mean;    /* 3 N: xyz after xyz, object frame; its box has a diagonal of about 1 */
  const double* basis;   /* 3 N rows of S */
  const double* normals; /* 3 N: outward, of unit length */
} spba_linear_prior;

/* Reads a prior file (.safetensors), such as those under share/spba/priors. */
SPBA_API spba_code spba_prior_load(const char* path, spba_prior** prior);
SPBA_API spba_code spba_prior_linear(const spba_linear_prior* arrays, spba_prior** prior);
SPBA_API void spba_prior_free(spba_prior* prior);
SPBA_API uint32_t spba_prior_style_count(const spba_prior* prior);
SPBA_API uint32_t spba_prior_point_count(const spba_prior* prior);
/* 1 where the derivative of X(s) is the same at every style, as it is for all but decoders; else 0. */
SPBA_API int32_t spba_prior_is_linear(const spba_prior* prior);
/* X(s) of the first `point_count` points, 3 an entry, and its derivative by s, 3 point_count rows of S.
 * `style` has S entries. Either output may be NULL. */
SPBA_API spba_code spba_prior_evaluate(const spba_prior* prior, const double* style, uint32_t point_count,
                                       double* points, double* jacobian);

/* x_b = scale R x_a + t. */
typedef struct spba_similarity {
  double scale;
  double quaternion_wxyz[4];
  double translation[3];
} spba_similarity;

/* From the frame of X(s) to the object frame, where the shape tells it: for a prior of surfaces, which knows
 * the whole body's box. SPBA_NOT_THERE: X(s) is in the object frame. A spba_solution is in the object frame
 * already. */
SPBA_API spba_code spba_prior_canonical_from_shape(const spba_prior* prior, const double* style,
                                                   spba_similarity* canonical_from_shape);

/* ---- Options ---- */

typedef struct spba_options spba_options;

/* The keys of `spba-ceres solve --print-config`, but those about files (prior, input other than
 * input.target, start). An unknown key is an error. */
SPBA_API spba_code spba_options_from_toml(const char* toml, spba_options** options);
SPBA_API void spba_options_free(spba_options* options);

/* ---- Solve ---- */

typedef struct spba_progress {
  uint32_t struct_size;
  uint32_t step;      /* of the stage */
  uint32_t iteration; /* of the step */
  const char* stage;  /* "initialise", "hypothesis-2/round-0/level-2", "level-1" ... */
  double objective;   /* not a number while initialising */
  double seconds;     /* since the solve began */
} spba_progress;

/* Returns 0 to stop the solve, which then ends within half a second. Called from threads of the library, one
 * at a time. Must not throw, and must not call back into the same handles. */
typedef int32_t (*spba_observer)(void* user, const spba_progress* progress);

typedef int32_t spba_log_level;
enum { SPBA_LOG_DEBUG = 0, SPBA_LOG_INFO = 1, SPBA_LOG_WARNING = 2, SPBA_LOG_ERROR = 3 };

/* Gets this library's messages about one solve. Called as the observer is. What Ceres logs goes where the
 * host's glog sends it: the library neither sets glog up nor redirects it. */
typedef void (*spba_log_sink)(void* user, spba_log_level level, const char* message);

typedef struct spba_callbacks {
  uint32_t struct_size;
  spba_observer observer; /* NULL: none */
  void* observer_user;
  spba_log_sink log; /* NULL: none */
  void* log_user;
} spba_callbacks;

typedef struct spba_solution spba_solution;

/* Solves on threads of its own (options: threads; 0 = one a core), which end with the call; the result does
 * not depend on how many there are. `options` NULL: the defaults. `callbacks` NULL: none. Two solves may run
 * at once. Stopped by the observer after initialisation, it gives the best solution so far. */
SPBA_API spba_code spba_solve(const spba_sequence* sequence, const spba_prior* prior,
                              const spba_options* options, const spba_callbacks* callbacks,
                              spba_solution** solution);
SPBA_API void spba_solution_free(spba_solution* solution);

typedef int32_t spba_status;
enum {
  SPBA_BELOW_THRESHOLD = 0,
  SPBA_CONVERGED = 1,
  SPBA_STEP_LIMIT = 2,
  SPBA_STOPPED = 3 /* by the observer; the best so far */
};

typedef struct spba_summary {
  uint32_t struct_size;
  spba_status status;
  uint32_t frame_count;
  uint32_t style_count;
  uint32_t free_form_count;
  uint32_t point_count;
  uint32_t face_count;
  uint32_t iterations;
  double objective_start;
  double objective_end;
  double alpha;        /* object diagonals a unit of the host's poses and depths */
  double focal_factor; /* by which all focal lengths were multiplied; 1 where they were held */
} spba_summary;

SPBA_API spba_code spba_solution_summary(const spba_solution* solution, spba_summary* summary);
/* Frames are counted as they were added. Translation in object diagonals. */
SPBA_API spba_code spba_solution_cam_from_object(const spba_solution* solution, uint32_t frame,
                                                 spba_pose* cam_from_object);
/* In [0, 1]: how well the shape in this frame covers the mask (intersection over union). */
SPBA_API spba_code spba_solution_silhouette_iou(const spba_solution* solution, uint32_t frame, double* iou);
/* SPBA_NOT_THERE where no frame has a cam_from_world. */
SPBA_API spba_code spba_solution_object_from_world(const spba_solution* solution,
                                                   spba_similarity* object_from_world);
/* The arrays live as long as the solution. Points and normals: 3 an entry, object frame; faces: 3 indices of
 * points, counter-clockwise from outside where the prior is one of surfaces. */
SPBA_API const double* spba_solution_style(const spba_solution* solution);
SPBA_API const double* spba_solution_free_form(const spba_solution* solution);
SPBA_API const double* spba_solution_points(const spba_solution* solution);
SPBA_API const double* spba_solution_normals(const spba_solution* solution);
SPBA_API const uint32_t* spba_solution_faces(const spba_solution* solution);

/* ---- Correspondences, for a problem of the host's own (spba/functors/) ---- */

/* What the solver would compare, point by point, and with what weight. The cost of a residual r is
 * weight / 2 rho(|r|^2), rho being the loss that spba_weights gives the width of. */
typedef struct spba_correspondences spba_correspondences;

/* A point whose colours in two frames are compared (Huber). */
typedef struct spba_compared_point {
  uint32_t point;
  uint32_t frame_a;
  uint32_t frame_b;
  uint32_t reserved;
  double weight;
} spba_compared_point;

/* The host's inverse depth where a frame sees a point (Huber), in inverse units of its poses. */
typedef struct spba_known_inverse_depth {
  uint32_t point;
  uint32_t frame;
  double pixel[2]; /* column, row */
  double inverse_depth;
  double slope[2]; /* of inverse_depth by column and row, a pixel */
  double weight;   /* a factor on spba_weights' inverse_depth_weight */
} spba_known_inverse_depth;

/* Who is nearest to whom in one frame (Cauchy). The arrays live as long as the correspondences and stay where
 * they are: an update changes what is in them. */
typedef struct spba_silhouette_matches {
  uint32_t struct_size;
  uint32_t pixel_count;
  uint32_t point_count;           /* of the first points of the prior */
  double pixel_weight;            /* of each pixel */
  const double* pixels;           /* 2 a pixel: its centre */
  const uint32_t* point_of_pixel; /* the nearest point of each pixel */
  const double* pixel_of_point;   /* 2 a point: the mask's pixel nearest to it */
  const double* point_weights;    /* one a point */
} spba_silhouette_matches;

typedef struct spba_weights {
  uint32_t struct_size;
  uint32_t point_count;        /* of the prior that may be named: the first so many */
  double photometric_huber;    /* colour levels */
  double silhouette_cauchy;    /* pixels; 0: squares */
  double silhouette_tolerance; /* pixels */
  double inverse_depth_weight; /* of each, times its own */
  double inverse_depth_huber;  /* inverse units of the poses */
  double style_weight;         /* the cost is style_weight / 2 |s|^2 */
} spba_weights;

/* At an estimate: a pose per frame, S styles and alpha (object diagonals a unit of the host's poses).
 * `options` NULL: the defaults. alpha also sets the unit in which inverse depths are weighed from then on. */
SPBA_API spba_code spba_correspondences_new(const spba_sequence* sequence, const spba_prior* prior,
                                            const spba_options* options, const spba_pose* cam_from_object,
                                            const double* style, double alpha,
                                            spba_correspondences** correspondences);
SPBA_API void spba_correspondences_free(spba_correspondences* correspondences);
/* Finds all anew, as the solver does before each of its steps: add the residual blocks anew after it. */
SPBA_API spba_code spba_correspondences_update(spba_correspondences* correspondences,
                                               const spba_pose* cam_from_object, const double* style,
                                               double alpha);
/* Finds anew who is nearest to whom in the silhouettes alone, as the solver does in every evaluation: call it
 * from the host's EvaluationCallback. The residual blocks stay. */
SPBA_API spba_code spba_correspondences_rematch(spba_correspondences* correspondences,
                                                const spba_pose* cam_from_object, const double* style,
                                                double alpha);
SPBA_API spba_code spba_correspondences_weights(const spba_correspondences* correspondences,
                                                spba_weights* weights);
/* Until the next update. */
SPBA_API spba_code spba_correspondences_compared(const spba_correspondences* correspondences,
                                                 const spba_compared_point** compared, size_t* count);
SPBA_API spba_code spba_correspondences_inverse_depths(const spba_correspondences* correspondences,
                                                       const spba_known_inverse_depth** depths,
                                                       size_t* count);
SPBA_API spba_code spba_correspondences_silhouette(const spba_correspondences* correspondences,
                                                   uint32_t frame, spba_silhouette_matches* matches);

#ifdef __cplusplus
}
#endif

#endif /* SPBA_SPBA_H_ */
