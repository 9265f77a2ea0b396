/* SPDX-License-Identifier: MIT */
#include "core/ifc_site.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/crs.h"
#include "core/grow.h"
#include "core/import/ifc/ifc_index.h"
#include "core/import/ifc/ifc_text.h"
#include "core/import/ifc/ifc_unit.h"
#include "core/import/ifc/step.h"

/* Places of attributes in a record, IFC2x3 TC1 and IFC4 ADD2. IfcMapConversionScaled is of IFC 4.3. */
enum { SITE_PLACEMENT = 5, SITE_LATITUDE = 9, SITE_LONGITUDE = 10, SITE_ELEVATION = 11, SITE_ARGS = 14 };
enum { CONTEXT_TYPE = 1, CONTEXT_WORLD = 4, CONTEXT_NORTH = 5, CONTEXT_ARGS = 6 };
enum { MAP_CRS = 1, MAP_EASTING, MAP_NORTHING, MAP_HEIGHT, MAP_ABSCISSA, MAP_ORDINATE, MAP_SCALE, MAP_ARGS };
enum { MAP_FACTOR_X = MAP_ARGS, MAP_FACTOR_Y, MAP_FACTOR_Z, MAP_SCALED_ARGS };
enum { CRS_NAME = 0, CRS_UNIT = 6, CRS_ARGS = 7 };

static const char ADVICE[] = "use scene.anchor.source: explicit, which needs none of this";

struct reader {
    struct ifc_index index;
    struct step_record site, context;
    struct step_record *map; /* [n_maps], of any context */
    size_t n_maps, room_maps;
    int n_sites, n_contexts, is_model;
    struct sh_err *err;
};

static int ifc_site_fail(struct reader *r, const struct step_record *at, const char *what)
{
    char text[256];
    snprintf(text, sizeof text, "%.190s; %s", what, ADVICE);
    return ifc_index_fail(&r->index, at, r->err, text);
}

/* Adds advice to the error of a unit. */
static int advise(struct reader *r, int rc)
{
    const struct sh_err said = *r->err;
    return rc == SH_EINPUT ? sh_fail(r->err, rc, "%.440s; %s", said.text, ADVICE) : rc;
}

/* A site without angles does not count; it is another part of a complex. */
static int is_located(const struct step_record *site)
{
    struct text_span arg[SITE_ARGS];
    return step_split(site->args, arg, SITE_ARGS) != SITE_ARGS || !text_is(arg[SITE_LATITUDE], "$") ||
           !text_is(arg[SITE_LONGITUDE], "$");
}

/* Contexts of type 'Model' go before those of plans. */
static int take_context(struct reader *r, const struct step_record *record)
{
    struct text_span arg[CONTEXT_ARGS];
    if (step_split(record->args, arg, CONTEXT_ARGS) != CONTEXT_ARGS)
        return ifc_site_fail(r, record, "not the 6 attributes that IFC defines");
    int is_model = text_is(arg[CONTEXT_TYPE], "'Model'");
    if (r->n_contexts++ == 0 || (is_model && !r->is_model)) {
        r->context = *record;
        r->is_model = is_model;
    }
    return SH_OK;
}

static int take_record(struct reader *r, const struct step_record *record)
{
    if (text_is(record->type, "IFCSITE") && is_located(record)) {
        r->site = *record;
        if (r->n_sites++ > 0) return ifc_site_fail(r, record, "a second site with a latitude; allowed one");
    }
    if (text_is(record->type, "IFCMAPCONVERSION") || text_is(record->type, "IFCMAPCONVERSIONSCALED")) {
        if (!grow(&r->map, &r->room_maps, r->n_maps + 1, sizeof *r->map)) return ifc_no_memory(&r->index, r->err);
        r->map[r->n_maps++] = *record;
    }
    return text_is(record->type, "IFCGEOMETRICREPRESENTATIONCONTEXT") ? take_context(r, record) : SH_OK;
}

static int collect(struct reader *r)
{
    int rc = SH_OK;
    for (size_t i = 0; i < r->index.n && rc == SH_OK; i++)
        rc = take_record(r, &r->index.record[i]);
    if (rc == SH_OK && r->n_sites == 0 && r->n_maps == 0)
        return text_fail(&r->index.text, 0, SH_EINPUT, r->err,
                         "no IFCMAPCONVERSION, and no IFCSITE with RefLatitude and RefLongitude; %s", ADVICE);
    return rc;
}

/* A record with its attributes. */
struct found {
    struct step_record record;
    struct text_span arg[STEP_MAX_ARGS];
};

/* Gives the record that an attribute refers to. The record must have this type and at least n attributes (n <=
 * STEP_MAX_ARGS). */
static int ifc_site_follow(struct reader *r, const struct step_record *from, struct text_span ref, const char *type,
                           size_t n, struct found *to)
{
    char what[96];
    snprintf(what, sizeof what, "a reference to %s is missing", type);
    const struct step_record *record = ifc_index_follow(&r->index, ref, type);
    if (record == NULL) return ifc_site_fail(r, from, what);
    to->record = *record;
    if (step_split(to->record.args, to->arg, STEP_MAX_ARGS) < n)
        return ifc_site_fail(r, &to->record, "attributes are missing");
    return SH_OK;
}

/* Whole degrees, minutes, seconds, and perhaps millionths of seconds, all of one sign. */
static int read_angle(struct reader *r, struct text_span span, const char *name, double limit_deg, double *deg)
{
    static const double per_deg[4] = {1.0, 60.0, 3600.0, 3.6e9};
    static const long limit[4] = {360, 60, 60, 1000000};
    struct text_span list, part[4];
    char what[160];
    long value[4], sign = 0;
    size_t n = step_list(span, &list) ? step_split(list, part, 4) : 0;
    snprintf(what, sizeof what, "%s has %zu components; allowed 3 or 4: degrees, minutes, seconds, millionths", name,
             n);
    if (n != 3 && n != 4) return ifc_site_fail(r, &r->site, what);
    *deg = 0.0;
    for (size_t i = n; i-- > 0;) {
        snprintf(what, sizeof what, "%s: component %zu is not a whole number within %ld", name, i + 1, limit[i]);
        if (!step_integer(part[i], &value[i]) || value[i] <= -limit[i] || value[i] >= limit[i])
            return ifc_site_fail(r, &r->site, what);
        snprintf(what, sizeof what, "%s: components of different sign; allowed all of one", name);
        if (value[i] != 0 && sign != 0 && (value[i] > 0) != (sign > 0)) return ifc_site_fail(r, &r->site, what);
        if (value[i] != 0) sign = value[i];
        *deg += (double)value[i] / per_deg[i];
    }
    snprintf(what, sizeof what, "%s of %.9g deg; allowed -%g to %g deg", name, *deg, limit_deg, limit_deg);
    return fabs(*deg) <= limit_deg ? SH_OK : ifc_site_fail(r, &r->site, what);
}

/* Reads min to max numbers of "(a, b, c)"; max <= 3. */
static int read_numbers(struct reader *r, const struct step_record *at, struct text_span span, size_t min, size_t max,
                        double *value)
{
    struct text_span list, part[3];
    size_t n = step_list(span, &list) ? step_split(list, part, 3) : 0;
    if (n < min || n > max) return ifc_site_fail(r, at, min < 3 ? "needs 2 or 3 numbers" : "needs 3 numbers");
    for (size_t i = 0; i < n; i++)
        if (!step_real(&r->index.text, part[i], &value[i]))
            return ifc_site_fail(r, at, "a coordinate that is not a number");
    return SH_OK;
}

/* Reads the location of an IFCAXIS2PLACEMENT3D, in units of the file, and its z and x axes. */
static int read_axes(struct reader *r, const struct step_record *from, struct text_span ref, double location[3],
                     double axes[2][3])
{
    static const double plain[2][3] = {{0.0, 0.0, 1.0}, {1.0, 0.0, 0.0}};
    struct found placement, found;
    int rc = ifc_site_follow(r, from, ref, "IFCAXIS2PLACEMENT3D", 3, &placement);
    if (rc == SH_OK) rc = ifc_site_follow(r, &placement.record, placement.arg[0], "IFCCARTESIANPOINT", 1, &found);
    if (rc == SH_OK) rc = read_numbers(r, &found.record, found.arg[0], 3, 3, location);
    for (int i = 0; i < 2 && rc == SH_OK; i++) {
        memcpy(axes[i], plain[i], sizeof plain[i]);
        if (text_is(placement.arg[1 + i], "$")) continue;
        rc = ifc_site_follow(r, &placement.record, placement.arg[1 + i], "IFCDIRECTION", 1, &found);
        if (rc == SH_OK) rc = read_numbers(r, &found.record, found.arg[0], 3, 3, axes[i]);
    }
    return rc;
}

/* The location of the site's own placement is the point that has latitude and longitude. The placement must be
 * absolute. */
static int read_origin(struct reader *r, struct text_span ref, double unit_m, double origin_m[3])
{
    struct found local;
    double axes[2][3];
    memset(origin_m, 0, 3 * sizeof *origin_m);
    if (text_is(ref, "$")) return SH_OK;
    int rc = ifc_site_follow(r, &r->site, ref, "IFCLOCALPLACEMENT", 2, &local);
    if (rc != SH_OK) return rc;
    if (!text_is(local.arg[0], "$"))
        return ifc_site_fail(r, &local.record, "the site's placement is relative to another; allowed absolute");
    rc = read_axes(r, &local.record, local.arg[1], origin_m, axes);
    for (int i = 0; i < 3; i++)
        origin_m[i] *= unit_m;
    return rc;
}

/* TrueNorth counts in the world coordinate system, which has to be the model's own. */
static int read_north(struct reader *r, struct ifc_site *site)
{
    struct text_span arg[CONTEXT_ARGS];
    struct found direction;
    double at[3], axes[2][3], north[3];
    if (r->n_contexts == 0) return SH_OK;
    step_split(r->context.args, arg, CONTEXT_ARGS);
    int rc = read_axes(r, &r->context, arg[CONTEXT_WORLD], at, axes);
    if (rc != SH_OK) return rc;
    for (int i = 0; i < 3; i++)
        if (at[i] != 0.0 || fabs(axes[0][i] - (i == 2)) > 1e-9 || fabs(axes[1][i] - (i == 0)) > 1e-9)
            return ifc_site_fail(r, &r->context,
                                 "a WorldCoordinateSystem that is shifted or turned; allowed the origin");
    if (text_is(arg[CONTEXT_NORTH], "$")) return SH_OK;
    rc = ifc_site_follow(r, &r->context, arg[CONTEXT_NORTH], "IFCDIRECTION", 1, &direction);
    if (rc == SH_OK) rc = read_numbers(r, &direction.record, direction.arg[0], 2, 3, north);
    if (rc != SH_OK) return rc;
    if (!(hypot(north[0], north[1]) > 1e-9))
        return ifc_site_fail(r, &direction.record, "a true north without a direction");
    site->north_deg = angle_deg(atan2(north[0], north[1]));
    return SH_OK;
}

/* ---- the map */

/* The 1 % leaves room for the map's own scale, which differs from 1 by less. */
static bool is_about(double a, double b)
{
    return fabs(a / b - 1.0) < 0.01;
}

/* Returns the unit of maps that is meant by m metres, or NaN. The two kinds of foot differ by 2e-6, less than the map's
 * own scale, so m can't tell them apart: the unit of the system's axes goes before all others. Where PROJ doesn't know
 * the system, it is the usual unit nearest to m, where the model's own goes before an equal one. */
static double map_unit_m(const char *crs, double m, double model_m)
{
    const double usual[] = {model_m, 1.0, 0.3048, 1200.0 / 3937.0};
    double nearest_m = NAN, axis_m;
    struct sh_err unknown;
    if (crs_unit(crs, 0, &axis_m, &unknown) == SH_OK && is_about(m, axis_m)) return axis_m;
    for (size_t i = 0; i < sizeof usual / sizeof usual[0]; i++)
        if (is_about(m, usual[i]) && !(fabs(m / usual[i] - 1.0) >= fabs(m / nearest_m - 1.0))) nearest_m = usual[i];
    return nearest_m;
}

/* A map conversion that is being read, with its numbers by the places of attributes. */
struct conversion {
    const struct step_record *record;
    double value[MAP_SCALED_ARGS];
    double scale; /* of the x axis: Scale times FactorX */
};

/* The scale has to be the factor from the model's unit to MapUnit, up to 1 % for the map's own scale. A Scale of 1 says
 * nothing, since it also stands for one that is left out. */
static int check_scale(struct reader *r, const struct conversion *c, double expected)
{
    char what[128];
    if (c->value[MAP_SCALE] == 1.0 && is_about(c->scale, 1.0)) return SH_OK;
    if (is_about(c->scale, expected)) return SH_OK;
    snprintf(what, sizeof what,
             "a Scale of %.9g beside a MapUnit; allowed about %.9g, the model's unit in units of the map", c->scale,
             expected);
    return ifc_site_fail(r, c->record, what);
}

/* IFC 4.3 multiplies each axis by Scale and by a factor of its own. The model is not stretched here. Factors that
 * differ by less than 1 % are a map's own scale, as above. */
static int check_factors(struct reader *r, const struct conversion *c)
{
    const double *v = c->value;
    char what[160];
    for (int i = MAP_SCALE; i < MAP_SCALED_ARGS; i++)
        if (!(v[i] > 0.0))
            return ifc_site_fail(r, c->record,
                                 i == MAP_SCALE ? "a Scale that is not above 0"
                                                : "a factor of an axis that is not above 0");
    for (int i = MAP_FACTOR_Y; i <= MAP_FACTOR_Z; i++) {
        if (is_about(v[i], v[MAP_FACTOR_X])) continue;
        snprintf(
            what, sizeof what,
            "factors of %.9g, %.9g and %.9g for the axes; allowed within 1 %% of each other, since the model is not "
            "stretched",
            v[MAP_FACTOR_X], v[MAP_FACTOR_Y], v[MAP_FACTOR_Z]);
        return ifc_site_fail(r, c->record, what);
    }
    return SH_OK;
}

static int read_map_unit(struct reader *r, const struct conversion *c, const struct found *crs, const char *name,
                         double model_m, double *m)
{
    uint64_t id;
    if (step_reference(crs->arg[CRS_UNIT], &id)) {
        int rc = advise(r, ifc_unit_of(&r->index, ifc_index_find(&r->index, id), m, r->err));
        return rc == SH_OK ? check_scale(r, c, model_m / *m) : rc;
    }
    *m = map_unit_m(name, model_m / c->scale, model_m);
    return isnan(*m) ? ifc_site_fail(r, c->record, "its Scale fits no unit of maps, and the system has no MapUnit")
                     : SH_OK;
}

/* Reads a number of the map conversion. Eastings and Northings must be there; a height that is missing is NaN. */
static int read_number(struct reader *r, struct conversion *c, struct text_span arg, int which)
{
    static const char *const name[MAP_SCALED_ARGS] = {
        [MAP_EASTING] = "Eastings",       [MAP_NORTHING] = "Northings",     [MAP_HEIGHT] = "OrthogonalHeight",
        [MAP_ABSCISSA] = "XAxisAbscissa", [MAP_ORDINATE] = "XAxisOrdinate", [MAP_SCALE] = "Scale",
        [MAP_FACTOR_X] = "FactorX",       [MAP_FACTOR_Y] = "FactorY",       [MAP_FACTOR_Z] = "FactorZ"};
    double *value = &c->value[which];
    char what[64];
    *value = which == MAP_HEIGHT ? NAN : which == MAP_ORDINATE ? 0.0 : 1.0;
    if (text_is(arg, "$") && which > MAP_NORTHING) return SH_OK;
    if (step_real(&r->index.text, arg, value)) return SH_OK;
    snprintf(what, sizeof what, "%s is missing, or is not a number", name[which]);
    return ifc_site_fail(r, c->record, what);
}

static int read_map_name(struct reader *r, const struct found *crs, struct ifc_map *map)
{
    char *name = ifc_text(crs->arg[CRS_NAME]);
    if (name == NULL) return ifc_no_memory(&r->index, r->err);
    const size_t n = strlen(name);
    if (n > 0 && n < sizeof map->crs) memcpy(map->crs, name, n + 1);
    free(name);
    return map->crs[0] != '\0'
               ? SH_OK
               : ifc_site_fail(r, &crs->record,
                               "its name is missing or over 127 bytes long; allowed is one such as \"EPSG:25832\"");
}

static int read_map_numbers(struct reader *r, struct conversion *c, const struct text_span *arg, int n)
{
    int rc = SH_OK;
    for (int i = MAP_FACTOR_X; i <= MAP_FACTOR_Z; i++)
        c->value[i] = 1.0;
    for (int i = MAP_EASTING; i < n && rc == SH_OK; i++)
        rc = read_number(r, c, arg[i], i);
    if (rc == SH_OK) rc = check_factors(r, c);
    c->scale = c->value[MAP_SCALE] * c->value[MAP_FACTOR_X];
    if (rc == SH_OK && !(hypot(c->value[MAP_ABSCISSA], c->value[MAP_ORDINATE]) > 1e-9))
        rc = ifc_site_fail(r, c->record, "an x axis without a direction");
    return rc;
}

static int read_map(struct reader *r, const struct step_record *record, double unit_m, struct ifc_map *map)
{
    const bool is_scaled = text_is(record->type, "IFCMAPCONVERSIONSCALED");
    const int n = is_scaled ? MAP_SCALED_ARGS : MAP_ARGS;
    struct conversion c = {.record = record};
    struct text_span arg[STEP_MAX_ARGS];
    struct found crs;
    double m = 1.0; /* metres per unit of the map */
    *map = (struct ifc_map){.crs = ""};
    if (step_split(record->args, arg, STEP_MAX_ARGS) < (size_t)n)
        return ifc_site_fail(
            r, record, is_scaled ? "not the 11 attributes that IFC defines" : "not the 8 attributes that IFC defines");
    int rc = ifc_site_follow(r, record, arg[MAP_CRS], "IFCPROJECTEDCRS", CRS_ARGS, &crs);
    if (rc == SH_OK) rc = read_map_name(r, &crs, map);
    if (rc == SH_OK) rc = read_map_numbers(r, &c, arg, n);
    if (rc == SH_OK) rc = read_map_unit(r, &c, &crs, map->crs, unit_m, &m);
    if (rc != SH_OK) return rc;
    map->easting_m = c.value[MAP_EASTING] * m;
    map->northing_m = c.value[MAP_NORTHING] * m;
    map->height_m = c.value[MAP_HEIGHT] * m;
    map->x_axis_rad = atan2(c.value[MAP_ORDINATE], c.value[MAP_ABSCISSA]);
    return SH_OK;
}

static bool is_same_number(double a, double b)
{
    return (isnan(a) && isnan(b)) || fabs(a - b) < 1e-9;
}

/* A model may have a map conversion for each of its contexts, as those of the model and of plans. They have to say the
 * same. */
static int read_maps(struct reader *r, double unit_m, struct ifc_map *map)
{
    struct ifc_map other;
    int rc = read_map(r, &r->map[0], unit_m, map);
    for (size_t i = 1; i < r->n_maps && rc == SH_OK; i++) {
        rc = read_map(r, &r->map[i], unit_m, &other);
        if (rc == SH_OK &&
            (strcmp(map->crs, other.crs) != 0 || !is_same_number(map->easting_m, other.easting_m) ||
             !is_same_number(map->northing_m, other.northing_m) || !is_same_number(map->height_m, other.height_m) ||
             !is_same_number(map->x_axis_rad, other.x_axis_rad)))
            rc = ifc_site_fail(r, &r->map[i],
                               "a second map conversion, which says something else; allowed one, or equal ones");
    }
    return rc;
}

/* ---- the site */

static int read_site(struct reader *r, double unit_m, struct ifc_site *site)
{
    struct text_span arg[SITE_ARGS];
    if (step_split(r->site.args, arg, SITE_ARGS) != SITE_ARGS)
        return ifc_site_fail(r, &r->site, "not the 14 attributes that IFC defines");
    int rc = read_angle(r, arg[SITE_LATITUDE], "RefLatitude", 90.0, &site->lat_deg);
    if (rc == SH_OK) rc = read_angle(r, arg[SITE_LONGITUDE], "RefLongitude", 180.0, &site->lon_deg);
    if (rc == SH_OK) rc = read_origin(r, arg[SITE_PLACEMENT], unit_m, site->origin_m);
    if (rc != SH_OK) return rc;
    if (!text_is(arg[SITE_ELEVATION], "$") && !step_real(&r->index.text, arg[SITE_ELEVATION], &site->elevation_m))
        return ifc_site_fail(r, &r->site, "RefElevation is not a number");
    site->elevation_m *= unit_m;
    return SH_OK;
}

int ifc_site_read(const char *path, struct ifc_site *site, struct sh_err *err)
{
    struct reader r = {.err = err};
    double unit_m = 1.0;
    *site = (struct ifc_site){.elevation_m = NAN};
    int rc = ifc_index_open(&r.index, path, err);
    if (rc == SH_OK) rc = collect(&r);
    if (rc == SH_OK) rc = advise(&r, ifc_unit_find(&r.index, &unit_m, err));
    if (rc == SH_OK && r.n_sites > 0) rc = read_site(&r, unit_m, site);
    if (rc == SH_OK) rc = read_north(&r, site);
    if (rc == SH_OK && r.n_maps > 0) rc = read_maps(&r, unit_m, &site->map);
    site->has_place = r.n_sites > 0;
    site->has_map = r.n_maps > 0;
    free(r.map);
    ifc_index_close(&r.index);
    return rc;
}
