/* SPDX-License-Identifier: MIT */
#include "core/georef/geographiclib_shim.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <memory>
#include <vector>

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/Geoid.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <GeographicLib/Math.hpp>
#include <GeographicLib/PolarStereographic.hpp>
#include <GeographicLib/TransverseMercator.hpp>
#include <GeographicLib/UTMUPS.hpp>

#include "core/mat3.h"

using GeographicLib::Geocentric, GeographicLib::Geoid, GeographicLib::LocalCartesian;
using GeographicLib::PolarStereographic, GeographicLib::TransverseMercator, GeographicLib::UTMUPS;

struct georef_geoid {
    Geoid geoid;
};

/* A UTM zone or UPS, without false origin. */
struct shim_grid {
    int zone; /* 0: UPS */
    bool north;

    void project(double lat, double lon, double &x, double &y, double &convergence, double &scale) const
    {
        if (zone == 0)
            PolarStereographic::UPS().Forward(north, lat, lon, x, y, convergence, scale);
        else
            TransverseMercator::UTM().Forward(6.0 * zone - 183.0, lat, lon, x, y, convergence, scale);
    }

    void project(double lat, double lon, double &x, double &y) const
    {
        double convergence, scale;
        project(lat, lon, x, y, convergence, scale);
    }

    void unproject(double x, double y, double &lat, double &lon) const
    {
        double convergence, scale;
        if (zone == 0)
            PolarStereographic::UPS().Reverse(north, x, y, lat, lon, convergence, scale);
        else
            TransverseMercator::UTM().Reverse(6.0 * zone - 183.0, x, y, lat, lon, convergence, scale);
    }
};

/* Turns a zone of core/georef.h (0: by position, GEOREF_UPS) into one of UTMUPS. */
static int utmups_zone(int zone)
{
    return zone == 0 ? int(UTMUPS::STANDARD) : zone < 0 ? int(UTMUPS::UPS) : zone;
}

/* UTMUPS chooses and checks zone and hemisphere for the station, once. Points then go through UTMUPS's own
 * projections directly: UTMUPS would add 10,000 km to a point beyond the equator, and throw beyond the edge
 * of its table. */
struct shim_map {
    /* in: the scene frame */
    bool from_grid;
    LocalCartesian local; /* tangent */
    double turn[9];       /* prcs -> axes of `local` */
    double centre_m[3];   /* from the origin of `local`, in its axes */
    shim_grid in;         /* grid */
    double in_x0, in_y0;  /* of the centre */
    /* out */
    enum georef_crs crs;
    const georef_geoid *geoid;
    shim_grid grid;
    double place[3];  /* of the centre */
    double anchor[3]; /* of the centre, with false origin */
    double x0, y0;    /* of the centre, without false origin */

    double undulation(double lat, double lon) const
    {
        return geoid == nullptr ? 0.0 : geoid->geoid(lat, lon);
    }

    void set_frame(const georef_spec &spec)
    {
        from_grid = spec.prcs_is_grid != 0;
        std::copy_n(spec.rotation, 9, turn);
        local.Reset(place[0], place[1], place[2]);
        if (!from_grid) return;
        double x, y;
        bool north;
        UTMUPS::Forward(place[0], place[1], in.zone, north, x, y, spec.prcs_zone);
        in.north = spec.prcs_zone == 0 ? north : spec.prcs_north != 0;
        in.project(place[0], place[1], in_x0, in_y0);
    }

    /* Sets the false northing of the hemisphere `side` (georef.h). In UPS another hemisphere is another projection. */
    void force_side(int side)
    {
        if (crs != GEOREF_UTM || side == 0 || grid.north == (side > 0)) return;
        if (grid.zone == 0) throw GeographicLib::GeographicErr("UPS of the other hemisphere");
        grid.north = side > 0;
        anchor[1] += grid.north ? -1e7 : 1e7;
    }

    /* Chooses zone and hemisphere; set_zone as for UTMUPS. Throws where the zone does not reach. */
    void set_centre(int set_zone)
    {
        const double lat = place[0], lon = place[1];
        anchor[2] = place[2] - undulation(lat, lon);
        if (crs == GEOREF_GEODETIC) {
            anchor[0] = lat;
            anchor[1] = lon;
        } else if (crs == GEOREF_ECEF) {
            Geocentric::WGS84().Forward(lat, lon, place[2], anchor[0], anchor[1], anchor[2]);
        } else {
            UTMUPS::Forward(lat, lon, grid.zone, grid.north, anchor[0], anchor[1], set_zone);
            grid.project(lat, lon, x0, y0);
        }
    }

    /* d: from the centre, in prcs. */
    void to_place(double dx, double dy, double dz, double &lat, double &lon, double &height) const
    {
        if (from_grid) {
            in.unproject(in_x0 + dx, in_y0 + dy, lat, lon);
            height = place[2] + dz;
            return;
        }
        local.Reverse(centre_m[0] + (turn[0] * dx + turn[1] * dy + turn[2] * dz),
                      centre_m[1] + (turn[3] * dx + turn[4] * dy + turn[5] * dz),
                      centre_m[2] + (turn[6] * dx + turn[7] * dy + turn[8] * dz), lat, lon, height);
    }

    /* Moves the centre by d, in prcs. */
    void move_centre(const double d[3])
    {
        const bool was_north = grid.north;
        const double false_x = anchor[0] - x0, false_y = anchor[1] - y0;
        to_place(d[0], d[1], d[2], place[0], place[1], place[2]);
        for (int i = 0; i < 3; i++)
            centre_m[i] += turn[3 * i] * d[0] + turn[3 * i + 1] * d[1] + turn[3 * i + 2] * d[2];
        in_x0 += d[0];
        in_y0 += d[1];
        set_centre(grid.zone);
        if (crs != GEOREF_UTM) return;
        grid.north = was_north; /* no leap of 10,000 km on the equator */
        grid.project(place[0], place[1], x0, y0);
        anchor[0] = std::round(false_x) + x0;
        anchor[1] = std::round(false_y) + y0;
    }

    void forward(double dx, double dy, double dz, double &x, double &y, double &z) const
    {
        double lat, lon, height;
        to_place(dx, dy, dz, lat, lon, height);
        if (crs == GEOREF_ECEF) {
            Geocentric::WGS84().Forward(lat, lon, height, x, y, z);
            x -= anchor[0];
            y -= anchor[1];
            z -= anchor[2];
            return;
        }
        z = (height - undulation(lat, lon)) - anchor[2];
        if (crs == GEOREF_GEODETIC) {
            x = lat - place[0];
            y = GeographicLib::Math::AngDiff(place[1], lon);
            return;
        }
        grid.project(lat, lon, x, y);
        x -= x0;
        y -= y0;
    }

    void reverse(const double d[3], double out[3]) const
    {
        double lat = place[0] + d[0], lon = place[1] + d[1], height = d[2] + anchor[2], v[3];
        if (crs == GEOREF_UTM) grid.unproject(d[0] + x0, d[1] + y0, lat, lon);
        if (crs == GEOREF_ECEF)
            Geocentric::WGS84().Reverse(anchor[0] + d[0], anchor[1] + d[1], anchor[2] + d[2], lat, lon, height);
        else
            height += undulation(lat, lon);
        if (from_grid) {
            in.project(lat, lon, out[0], out[1]);
            out[0] -= in_x0;
            out[1] -= in_y0;
            out[2] = height - place[2];
            return;
        }
        local.Forward(lat, lon, height, v[0], v[1], v[2]);
        vec3_sub(v, centre_m, v);
        mat3_apply_transposed(turn, v, out);
    }
};

static const double nan_m = std::numeric_limits<double>::quiet_NaN();

/* Calls f. An exception becomes a text, and -1. */
template <typename F> static int attempt(char *why, size_t len, F f)
{
    try {
        f();
        return 0;
    } catch (const std::exception &e) {
        std::snprintf(why, len, "%s", e.what());
    } catch (...) {
        std::snprintf(why, len, "unknown failure in GeographicLib");
    }
    for (char *p = why; *p != 0; p++)
        if (*p == '\n') *p = ' ';
    return -1;
}

/* Calls f. After an exception the n values are NaN. */
template <typename F> static void attempt(double *value, size_t n, F f)
{
    try {
        f();
    } catch (...) {
        std::fill_n(value, n, nan_m);
    }
}

void shim_ecef(double lat_deg, double lon_deg, double height_m, double p_ecef[3], double rotation[9])
{
    std::fill_n(p_ecef, 3, nan_m);
    attempt(rotation, 9, [&] {
        std::vector<double> m(9);
        Geocentric::WGS84().Forward(lat_deg, lon_deg, height_m, p_ecef[0], p_ecef[1], p_ecef[2], m);
        std::copy(m.begin(), m.end(), rotation);
    });
}

void georef_geodetic(double lat_deg, double lon_deg, double height_m, const double d_enu[3], double geodetic[3])
{
    attempt(geodetic, 3, [&] {
        LocalCartesian(lat_deg, lon_deg, height_m)
            .Reverse(d_enu[0], d_enu[1], d_enu[2], geodetic[0], geodetic[1], geodetic[2]);
    });
}

void shim_locate_ecef(const double p_ecef[3], double place[3])
{
    attempt(place, 3,
            [&] { Geocentric::WGS84().Reverse(p_ecef[0], p_ecef[1], p_ecef[2], place[0], place[1], place[2]); });
}

int shim_locate_utm(int zone, int north, const double grid[2], struct georef_place *out, char *why, size_t len)
{
    return attempt(why, len, [&] { UTMUPS::Reverse(zone, north != 0, grid[0], grid[1], out->lat_deg, out->lon_deg); });
}

int shim_grid_at(const struct georef_place *place, int zone, struct locate_grid *out, char *why, size_t len)
{
    return attempt(why, len, [&] {
        bool north = false;
        UTMUPS::Forward(place->lat_deg, place->lon_deg, out->zone, north, out->easting_m, out->northing_m,
                        out->convergence_deg, out->scale, utmups_zone(zone));
        out->north = north;
    });
}

struct georef_geoid *shim_geoid_open(char *why, size_t len)
{
    struct georef_geoid *geoid = nullptr;
    attempt(why, len, [&] { geoid = new georef_geoid{Geoid(Geoid::DefaultGeoidName(), "", true, true)}; });
    return geoid;
}

void georef_geoid_free(struct georef_geoid *geoid)
{
    delete geoid;
}

struct shim_map *shim_map_create(const struct georef_spec *spec, char *why, size_t len)
{
    std::unique_ptr<shim_map> map;
    int rc = attempt(why, len, [&] {
        map.reset(new shim_map());
        map->crs = spec->crs;
        map->geoid = spec->geoid;
        map->place[0] = spec->lat_deg;
        map->place[1] = GeographicLib::Math::AngNormalize(spec->lon_deg);
        map->place[2] = spec->height_m;
        map->set_frame(*spec);
        map->set_centre(utmups_zone(spec->utm_zone));
        map->force_side(spec->side);
    });
    return rc == 0 ? map.release() : nullptr;
}

struct shim_map *shim_map_recentre(const struct shim_map *map, const double d_prcs[3], char *why, size_t len)
{
    std::unique_ptr<shim_map> moved;
    int rc = attempt(why, len, [&] {
        moved.reset(new shim_map(*map));
        moved->move_centre(d_prcs);
    });
    return rc == 0 ? moved.release() : nullptr;
}

void shim_map_free(struct shim_map *map)
{
    delete map;
}

void shim_map_anchor(const struct shim_map *map, double anchor[3])
{
    std::copy_n(map->anchor, 3, anchor);
}

void shim_map_place(const struct shim_map *map, double place[3])
{
    std::copy_n(map->place, 3, place);
}

/* The rotation goes from prcs to the axes of the tangent frame, then to ECEF, then to the centre's axes. */
static void meridian_of_metric(const struct shim_map *map, struct shim_meridian *out)
{
    double p[3], from[9], to[9];
    const LocalCartesian &local = map->local;
    shim_ecef(local.LatitudeOrigin(), local.LongitudeOrigin(), local.HeightOrigin(), p, from);
    shim_ecef(map->place[0], map->place[1], map->place[2], p, to);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double sum = 0.0;
            for (int k = 0; k < 3; k++)
                for (int m = 0; m < 3; m++)
                    sum += to[3 * k + i] * from[3 * k + m] * map->turn[3 * m + j];
            out->turn[3 * i + j] = sum;
        }
    out->axis_m = std::hypot(p[0], p[1]);
    out->sin_lat = to[8];
    out->cos_lat = to[7];
}

int shim_map_meridian(const struct shim_map *map, struct shim_meridian *out)
{
    *out = {};
    if (!map->from_grid) {
        meridian_of_metric(map, out);
        return 1;
    }
    if (map->in.zone != 0) return 0;
    /* x = rho sin lon, y = -rho cos lon about the north pole, rho cos lon about the south pole */
    out->axis_m = std::hypot(map->in_x0, map->in_y0);
    out->sin_lat = map->in.north ? 1.0 : -1.0;
    double x = map->in_x0 / out->axis_m, y = map->in_y0 / out->axis_m;
    const double turn[9] = {-y, x, 0.0, -x, -y, 0.0, 0.0, 0.0, 1.0};
    for (int i = 0; i < 9; i++)
        out->turn[i] = i < 6 ? out->sin_lat * turn[i] : turn[i];
    return 1;
}

int shim_map_epsg(const struct shim_map *map)
{
    if (map->crs == GEOREF_GEODETIC) return 4979;
    if (map->crs == GEOREF_ECEF) return 4978;
    return UTMUPS::EncodeEPSG(map->grid.zone, map->grid.north);
}

void shim_map_convergence(const struct shim_map *map, double *convergence_deg, double *scale)
{
    *convergence_deg = 0.0;
    *scale = 1.0;
    if (map->crs != GEOREF_UTM) return;
    char why[64];
    attempt(why, sizeof why, [&] {
        double x, y;
        map->grid.project(map->place[0], map->place[1], x, y, *convergence_deg, *scale);
    });
}

void shim_map_forward(const struct shim_map *map, size_t n, struct vec3_in d, struct vec3_out out)
{
    for (size_t i = 0; i < n; i++) {
        double p[3] = {nan_m, nan_m, nan_m};
        /* Checked first: the projections turn some NaN into plain numbers. */
        if (std::isfinite(d.x[i]) && std::isfinite(d.y[i]) && std::isfinite(d.z[i]))
            attempt(p, 3, [&] { map->forward(d.x[i], d.y[i], d.z[i], p[0], p[1], p[2]); });
        VEC3_SET(out, i, p);
    }
}

void shim_map_reverse(const struct shim_map *map, const double d_map[3], double d_prcs[3])
{
    std::fill_n(d_prcs, 3, nan_m);
    if (!std::isfinite(d_map[0]) || !std::isfinite(d_map[1]) || !std::isfinite(d_map[2])) return;
    attempt(d_prcs, 3, [&] { map->reverse(d_map, d_prcs); });
}
