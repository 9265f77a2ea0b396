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

/* east, north, up at a place -> latitude, longitude, height. */
void shim_geodetic(double lat_deg, double lon_deg, double height_m, const double d_local[3], double geodetic[3]);

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

#ifdef __cplusplus
}
#endif
#endif
