/* C view of what we use of GeographicLib. Private to core/georef. No exception crosses: each becomes a text.
 */
#ifndef CORE_GEOREF_GEOGRAPHICLIB_SHIM_H
#define CORE_GEOREF_GEOGRAPHICLIB_SHIM_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* WGS 84 geocentric position, and the rotation (row by row) of east, north, up at it to X, Y, Z. */
void shim_ecef(double lat_deg, double lon_deg, double height_m, double p_ecef[3], double rotation[9]);

/* Geodetic place (degrees, degrees, metres) of a geocentric position; not-a-number on failure. */
void shim_locate_ecef(const double p_ecef[3], double place[3]);
/* UTM zone, or UPS for zone 0, to degrees and back: 0, or -1 with the reason. zone 0 on the way there: by
 * position. */
int shim_locate_utm(int zone, int north, const double grid[2], double lat_lon_deg[2], char *why, size_t len);
int shim_to_utm(const double lat_lon_deg[2], int *zone, int *north, double grid[2], char *why, size_t len);

/* A local tangent frame and one grid zone. */
struct shim_grid;

/* zone: 1..60, or 0 for the standard zone, which beyond 84 N and 80 S is UPS. NULL on failure, with the
 * reason. */
struct shim_grid *shim_grid_create(double lat_deg, double lon_deg, double height_m, int zone, char *why, size_t len);
void shim_grid_free(struct shim_grid *grid);

/* Easting and northing with false origin, ellipsoidal height; EPSG code. */
void shim_grid_anchor(const struct shim_grid *grid, double anchor[3]);
int shim_grid_epsg(const struct shim_grid *grid);

/* east, north, up in metres <-> differences from the anchor. In place is allowed. */
void shim_grid_forward(const struct shim_grid *grid, size_t n, const double *dx, const double *dy, const double *dz,
                       double *out_x, double *out_y, double *out_z);
void shim_grid_reverse(const struct shim_grid *grid, const double d_grid[3], double d_local[3]);
/* The same for n points, in place or not. */
void shim_grid_to_local(const struct shim_grid *grid, size_t n, const double *dx, const double *dy, const double *dz,
                        double *out_x, double *out_y, double *out_z);

/* A place in a grid (locate.c): 0, or -1 with the reason. */
struct shim_utm {
    int zone, north; /* zone 0: UPS */
    double easting_m, northing_m, convergence_deg, scale;
};
/* zone: 1..60, or 0: by position */
int shim_utm_forward(double lat_deg, double lon_deg, int zone, struct shim_utm *out, char *why, size_t len);

#ifdef __cplusplus
}
#endif
#endif
