/* The unit of length of an IFC file's project. Readers of bodies apply it themselves; here it scales what the records say. */
#include <math.h>
#include <string.h>

#include "core/import/ifc/ifc_records.h"

enum { PROJECT_UNITS = 8 };

static const struct step_record *follow(const struct ifc_records *r, struct text_span ref, const char *type)
{
    uint64_t id;
    const struct step_record *to = step_reference(ref, &id) ? ifc_records_find(r, id) : NULL;
    return to != NULL && (type == NULL || text_is(to->type, type)) ? to : NULL;
}

double ifc_prefix(struct text_span prefix)
{
    static const struct {
        const char *name;
        double m;
    } known[] = {{"$", 1.0},        {".MILLI.", 1e-3}, {".CENTI.", 1e-2}, {".DECI.", 1e-1},
                 {".MICRO.", 1e-6}, {".KILO.", 1e3},   {".DECA.", 10.0},  {".HECTO.", 100.0}};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (text_is(prefix, known[i].name)) return known[i].m;
    return NAN;
}

/* One that is not known counts as none. */
static double prefix_or_none(struct text_span prefix)
{
    const double m = ifc_prefix(prefix);
    return isnan(m) ? 1.0 : m;
}

/* IfcMeasureWithUnit(measure(x), unit). */
static double converted(const struct ifc_records *r, const struct step_record *measure)
{
    struct text_span arg[2], of[4];
    if (measure == NULL || step_split(measure->args, arg, 2) != 2) return 1.0;
    const char *open = memchr(arg[0].p, '(', arg[0].n), *close = memrchr(arg[0].p, ')', arg[0].n);
    const struct step_record *si = follow(r, arg[1], "IFCSIUNIT");
    double factor;
    if (open == NULL || close == NULL || si == NULL || step_split(si->args, of, 4) != 4) return 1.0;
    if (!step_real(&r->text, (struct text_span){open + 1, (size_t)(close - open - 1)}, &factor)) return 1.0;
    return factor > 0.0 ? factor * prefix_or_none(of[2]) : 1.0;
}

static const struct step_record *units_of_project(const struct ifc_records *r)
{
    struct text_span arg[PROJECT_UNITS + 1];
    for (size_t i = 0; i < r->n; i++)
        if (text_is(r->record[i].type, "IFCPROJECT") &&
            step_split(r->record[i].args, arg, PROJECT_UNITS + 1) > PROJECT_UNITS)
            return follow(r, arg[PROJECT_UNITS], "IFCUNITASSIGNMENT");
    return NULL;
}

double ifc_unit_m(const struct ifc_records *r)
{
    const struct step_record *units = units_of_project(r);
    const char *p = units != NULL ? units->args.p : NULL, *end = units != NULL ? p + units->args.n : NULL;
    for (uint64_t id; p != NULL && (id = ifc_next_reference(&p, end)) != 0;) {
        const struct step_record *unit = ifc_records_find(r, id);
        struct text_span of[4];
        if (unit == NULL || step_split(unit->args, of, 4) != 4 || !text_is(of[1], ".LENGTHUNIT.")) continue;
        if (text_is(unit->type, "IFCSIUNIT")) return prefix_or_none(of[2]);
        if (text_is(unit->type, "IFCCONVERSIONBASEDUNIT")) return converted(r, follow(r, of[3], "IFCMEASUREWITHUNIT"));
    }
    return 1.0;
}
