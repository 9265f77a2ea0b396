/* SPDX-License-Identifier: MIT */
/* The unit of length of an IFC file's project. The readers of bodies apply this unit themselves. Callers of this file
 * apply it to figures that they take from the records, such as those of an anchor. */
#include "core/import/ifc/ifc_unit.h"

#include <string.h>

enum { PROJECT_UNITS = 8, PROJECT_ARGS = 9, SI_ARGS = 4 };

static int read_si(const struct ifc_index *x, const struct step_record *unit, double *m, struct sh_err *err)
{
    static const struct {
        const char *name;
        double m;
    } known[] = {{"$", 1.0},        {".MILLI.", 1e-3}, {".CENTI.", 1e-2}, {".DECI.", 1e-1},
                 {".MICRO.", 1e-6}, {".KILO.", 1e3},   {".DECA.", 10.0},  {".HECTO.", 100.0}};
    struct text_span of[SI_ARGS];
    if (step_split(unit->args, of, SI_ARGS) != SI_ARGS)
        return ifc_index_fail(x, unit, err, "not the 4 attributes that IFC defines");
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (text_is(of[2], known[i].name)) {
            *m = known[i].m;
            return SH_OK;
        }
    return ifc_index_fail(x, unit, err, "a length unit with an unknown prefix");
}

/* IFCCONVERSIONBASEDUNIT(dimensions, .LENGTHUNIT., name, #IFCMEASUREWITHUNIT(measure(x), #unit)): feet, for example. */
static int read_converted(const struct ifc_index *x, const struct step_record *unit, struct text_span ref, double *m,
                          struct sh_err *err)
{
    const struct step_record *measure = ifc_index_follow(x, ref, "IFCMEASUREWITHUNIT");
    struct text_span arg[2], list;
    double factor;
    if (measure == NULL) return ifc_index_fail(x, unit, err, "a reference to IFCMEASUREWITHUNIT is missing");
    if (step_split(measure->args, arg, 2) != 2) return ifc_index_fail(x, measure, err, "attributes are missing");
    const struct step_record *si = ifc_index_follow(x, arg[1], "IFCSIUNIT");
    if (si == NULL) return ifc_index_fail(x, measure, err, "a reference to IFCSIUNIT is missing");
    const char *open = memchr(arg[0].p, '(', arg[0].n);
    const size_t skip = open != NULL ? (size_t)(open - arg[0].p) : 0;
    if (!step_list((struct text_span){arg[0].p + skip, arg[0].n - skip}, &list) ||
        !step_real(&x->text, list, &factor) || factor <= 0.0)
        return ifc_index_fail(x, measure, err, "the factor of a length unit is missing");
    int rc = ifc_unit_of(x, si, m, err); /* a factor of radians, for example, gives no length */
    *m *= factor;
    return rc;
}

static bool is_length(const struct step_record *unit, struct text_span of[SI_ARGS])
{
    return step_split(unit->args, of, SI_ARGS) == SI_ARGS && text_is(of[1], ".LENGTHUNIT.") &&
           (text_is(unit->type, "IFCSIUNIT") || text_is(unit->type, "IFCCONVERSIONBASEDUNIT"));
}

int ifc_unit_of(const struct ifc_index *x, const struct step_record *unit, double *m, struct sh_err *err)
{
    struct text_span of[SI_ARGS];
    if (!is_length(unit, of)) return ifc_index_fail(x, unit, err, "not a unit of length");
    return text_is(unit->type, "IFCSIUNIT") ? read_si(x, unit, m, err) : read_converted(x, unit, of[3], m, err);
}

static int find_project(const struct ifc_index *x, const struct step_record **out, struct sh_err *err)
{
    int n = 0;
    for (size_t i = 0; i < x->n; i++) {
        if (!text_is(x->record[i].type, "IFCPROJECT")) continue;
        *out = &x->record[i];
        n++;
    }
    return n == 1 ? SH_OK : text_fail(&x->text, 0, SH_EINPUT, err, "%d IFCPROJECT records; allowed one", n);
}

int ifc_unit_find(const struct ifc_index *x, double *m, struct sh_err *err)
{
    struct text_span arg[PROJECT_ARGS], of[SI_ARGS];
    const struct step_record *project = NULL;
    int rc = find_project(x, &project, err);
    if (rc != SH_OK) return rc;
    if (step_split(project->args, arg, PROJECT_ARGS) != PROJECT_ARGS)
        return ifc_index_fail(x, project, err, "not the 9 attributes that IFC defines");
    const struct step_record *units = ifc_index_follow(x, arg[PROJECT_UNITS], "IFCUNITASSIGNMENT");
    if (units == NULL) return ifc_index_fail(x, project, err, "no unit of length: it names no IFCUNITASSIGNMENT");
    const char *p = units->args.p, *end = p + units->args.n;
    for (uint64_t id; ifc_next_reference(&p, end, &id);) {
        const struct step_record *unit = ifc_index_find(x, id);
        if (unit != NULL && is_length(unit, of)) return ifc_unit_of(x, unit, m, err);
    }
    return ifc_index_fail(x, units, err, "no unit of length");
}
