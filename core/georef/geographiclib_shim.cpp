#include "core/georef/geographiclib_shim.h"

#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <vector>

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <GeographicLib/PolarStereographic.hpp>
#include <GeographicLib/TransverseMercator.hpp>
#include <GeographicLib/UTMUPS.hpp>

using GeographicLib::Geocentric;
using GeographicLib::LocalCartesian;
using GeographicLib::PolarStereographic;
using GeographicLib::TransverseMercator;
using GeographicLib::UTMUPS;

/* UTMUPS chooses and checks zone and hemisphere for the station, once. Points go through the projections that
 * it uses itself: UTMUPS would add 10,000 km to a point beyond the equator and throw beyond the edge of its
 * table. */
struct shim_grid {
    LocalCartesian local;
    int zone; /* 0: UPS */
    bool north;
    double lon0_deg;
    double anchor[3]; /* with false origin */
    double x0, y0;    /* of the station, without */
    double height_m;

    void project(double lat, double lon, double &x, double &y) const
    {
        double convergence, scale;
        if (zone == 0)
            PolarStereographic::UPS().Forward(north, lat, lon, x, y, convergence, scale);
        else
            TransverseMercator::UTM().Forward(lon0_deg, lat, lon, x, y, convergence, scale);
    }

    void unproject(double x, double y, double &lat, double &lon) const
    {
        double convergence, scale;
        if (zone == 0)
            PolarStereographic::UPS().Reverse(north, x, y, lat, lon, convergence, scale);
        else
            TransverseMercator::UTM().Reverse(lon0_deg, x, y, lat, lon, convergence, scale);
    }
};

static const double nan_m = std::numeric_limits<double>::quiet_NaN();

void shim_ecef(double lat_deg, double lon_deg, double height_m, double p_ecef[3], double rotation[9])
{
    for (int i = 0; i < 3; i++)
        p_ecef[i] = nan_m;
    try {
        std::vector<double> m(9);
        Geocentric::WGS84().Forward(lat_deg, lon_deg, height_m, p_ecef[0], p_ecef[1], p_ecef[2], m);
        for (size_t i = 0; i < 9; i++)
            rotation[i] = m[i];
    } catch (...) {
        for (int i = 0; i < 9; i++)
            rotation[i] = nan_m;
    }
}

void shim_locate_ecef(const double p_ecef[3], double place[3])
{
    try {
        Geocentric::WGS84().Reverse(p_ecef[0], p_ecef[1], p_ecef[2], place[0], place[1], place[2]);
    } catch (...) {
        place[0] = place[1] = place[2] = nan_m;
    }
}

/* Runs what may throw; the reason becomes a text. */
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
    return -1;
}

int shim_locate_utm(int zone, int north, const double grid[2], double lat_lon_deg[2], char *why, size_t len)
{
    return attempt(why, len,
                   [&] { UTMUPS::Reverse(zone, north != 0, grid[0], grid[1], lat_lon_deg[0], lat_lon_deg[1]); });
}

int shim_to_utm(const double lat_lon_deg[2], int *zone, int *north, double grid[2], char *why, size_t len)
{
    return attempt(why, len, [&] {
        bool n = false;
        UTMUPS::Forward(lat_lon_deg[0], lat_lon_deg[1], *zone, n, grid[0], grid[1],
                        *zone == 0 ? int(UTMUPS::STANDARD) : *zone);
        *north = n;
    });
}

struct shim_grid *shim_grid_create(double lat_deg, double lon_deg, double height_m, int zone, char *why, size_t len)
{
    struct shim_grid *grid = nullptr;
    try {
        grid = new shim_grid;
        grid->local.Reset(lat_deg, lon_deg, height_m);
        UTMUPS::Forward(lat_deg, lon_deg, grid->zone, grid->north, grid->anchor[0], grid->anchor[1],
                        zone == 0 ? int(UTMUPS::STANDARD) : zone);
        grid->anchor[2] = height_m;
        grid->height_m = height_m;
        grid->lon0_deg = 6.0 * grid->zone - 183.0;
        grid->project(lat_deg, lon_deg, grid->x0, grid->y0);
        return grid;
    } catch (const std::exception &e) {
        std::snprintf(why, len, "%s", e.what());
    } catch (...) {
        std::snprintf(why, len, "unknown failure in GeographicLib");
    }
    delete grid;
    return nullptr;
}

void shim_grid_free(struct shim_grid *grid)
{
    delete grid;
}

void shim_grid_anchor(const struct shim_grid *grid, double anchor[3])
{
    for (int i = 0; i < 3; i++)
        anchor[i] = grid->anchor[i];
}

int shim_grid_epsg(const struct shim_grid *grid)
{
    try {
        return UTMUPS::EncodeEPSG(grid->zone, grid->north);
    } catch (...) {
        return 0;
    }
}

void shim_grid_forward(const struct shim_grid *grid, size_t n, const double *dx, const double *dy, const double *dz,
                       double *out_x, double *out_y, double *out_z)
{
    for (size_t i = 0; i < n; i++) {
        double x = nan_m, y = nan_m, z = nan_m;
        /* Asked first: the projections turn some not-a-number into plain numbers. */
        if (std::isfinite(dx[i]) && std::isfinite(dy[i]) && std::isfinite(dz[i])) {
            try {
                double lat, lon, height;
                grid->local.Reverse(dx[i], dy[i], dz[i], lat, lon, height);
                grid->project(lat, lon, x, y);
                x -= grid->x0;
                y -= grid->y0;
                z = height - grid->height_m;
            } catch (...) {
                x = y = z = nan_m;
            }
        }
        out_x[i] = x;
        out_y[i] = y;
        out_z[i] = z;
    }
}

void shim_grid_reverse(const struct shim_grid *grid, const double d_grid[3], double d_local[3])
{
    const double x = d_grid[0], y = d_grid[1], z = d_grid[2];
    d_local[0] = d_local[1] = d_local[2] = nan_m;
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z)) return;
    try {
        double lat, lon;
        grid->unproject(x + grid->x0, y + grid->y0, lat, lon);
        grid->local.Forward(lat, lon, z + grid->height_m, d_local[0], d_local[1], d_local[2]);
    } catch (...) {
        d_local[0] = d_local[1] = d_local[2] = nan_m;
    }
}

void shim_grid_to_local(const struct shim_grid *grid, size_t n, const double *dx, const double *dy, const double *dz,
                        double *out_x, double *out_y, double *out_z)
{
    for (size_t i = 0; i < n; i++) {
        double d_local[3];
        const double d_grid[3] = {dx[i], dy[i], dz[i]};
        shim_grid_reverse(grid, d_grid, d_local);
        out_x[i] = d_local[0];
        out_y[i] = d_local[1];
        out_z[i] = d_local[2];
    }
}

int shim_utm_forward(double lat_deg, double lon_deg, int zone, struct shim_utm *out, char *why, size_t len)
{
    return attempt(why, len, [&] {
        bool north = false;
        UTMUPS::Forward(lat_deg, lon_deg, out->zone, north, out->easting_m, out->northing_m, out->convergence_deg,
                        out->scale, zone == 0 ? int(UTMUPS::STANDARD) : zone);
        out->north = north;
    });
}
