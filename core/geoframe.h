/* SPDX-License-Identifier: MIT */
/* How the scene's frame (prcs) lies on the Earth. This module turns points of the scene into places on the Earth
 * (degrees, metres) and back, and gives rotations between the frames. The frame is set up once for a scene, so that all
 * stations agree.
 *   tangent  metric. One point of the scene, origin_m, is at a place on the Earth. z is the plumb line (the
 *            ellipsoid's normal) there, and true north there lies north_deg clockwise from the scene's y
 *            axis. Elsewhere z differs from the local plumb line by the angle that the two places make at the
 *            Earth's centre, about 0.009 deg per km.
 *   grid     prcs is easting, northing (with false origin) and ellipsoidal height of one UTM or UPS grid, as
 *            a mesh in such coordinates is. y is grid north, z the plumb line everywhere. Lengths are grid
 *            lengths: a true horizontal metre has the length k in the scene, the grid's scale there (0.9996 to
 *            1.0010 in UTM). Ranges have that factor, too. Points in that grid are the mesh's own coordinates to
 *            the last bit.
 *   ecef     prcs is ECEF, as a mesh in geocentric coordinates is. The axes of a head are those of its place:
 *            y true north, z the plumb line.
 * Constant after it is set up; any thread. */
#ifndef CORE_GEOFRAME_H
#define CORE_GEOFRAME_H

#include "core/err.h"
#include "core/georef.h"

enum geoframe_kind { GEOFRAME_TANGENT, GEOFRAME_GRID, GEOFRAME_ECEF };

struct geoframe {
    enum geoframe_kind kind;
    /* tangent: p_ecef = ecef_m + rotation (p_prcs - origin_m) */
    double origin_m[3], ecef_m[3], rotation[9];
    double lat_deg, lon_deg, height_m, north_deg;
    int zone, north; /* grid; zone 0: UPS */
};

int geoframe_set_tangent(struct geoframe *frame, const double origin_m[3], const struct georef_place *at,
                         double north_deg, struct sh_err *err);
int geoframe_set_grid(struct geoframe *frame, int zone, int north, struct sh_err *err);
void geoframe_set_ecef(struct geoframe *frame);

/* Point of the scene -> place on the Earth, and back. SH_EINPUT where there is none, as outside of a grid. */
int geoframe_locate(const struct geoframe *frame, const double p_prcs[3], struct georef_place *at, struct sh_err *err);
int geoframe_find(const struct geoframe *frame, const struct georef_place *at, double p_prcs[3], struct sh_err *err);

/* The rotation from the axes of a levelled head with heading 0 at p_prcs to prcs, row by row: the unit
 * matrix except for ecef. The rotation's third column is up. */
int geoframe_level(const struct geoframe *frame, const double p_prcs[3], double rotation[9], struct sh_err *err);

/* The rotation from prcs to east, north, up at p_prcs; for a grid without its scale. */
int geoframe_to_enu(const struct geoframe *frame, const double p_prcs[3], double rotation[9], struct sh_err *err);

/* Sets station, place and frame of a specification for a head at p_prcs. */
int geoframe_fill(const struct geoframe *frame, const double p_prcs[3], struct georef_spec *spec, struct sh_err *err);

#endif
