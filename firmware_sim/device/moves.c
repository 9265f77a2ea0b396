/* SPDX-License-Identifier: MIT */
/* Moving stations: a new site is planned without the lock, replaces the present one under the lock, and earlier ones
 * are freed when nobody uses them any more.
 *
 *   device_begin_move   the command is taken: from now on no scan starts and no other station moves
 *   device_plan_move    a site beside the present one is loaded (site_load_moved); may take long, without the lock
 *   device_take_move    it becomes the present site, for the ticks that are claimed from now on
 *   device_end_move     earlier sites that no tick uses any more are freed
 *
 * A caster may go on for a while with a tick that was given up as too late. So a tick holds the site that it was
 * claimed with. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/config/places.h"
#include "firmware_sim/device/device_state.h"
#include "firmware_sim/site/plan_rows.h"

/* A replay in real time plans the first moves of its journal before time begins: at most so many. */
enum { MAX_AHEAD = 16 };

static void read_move(const struct command_result *command, struct device_move *plan)
{
    const double *v = command->place.v;
    *plan = (struct device_move){.station = command->station - 1,
                                 .to_first = command->to_first,
                                 .took_control = command->took_control,
                                 .to = {{v[0], v[1], v[2]}, v[3], v[4], v[5]}};
}

/* Whether the station stands at the plan's place already in that site. */
static int is_there(const struct device_moves *moves, const struct site *site, const struct device_move *plan)
{
    struct site_place now, to = plan->to;
    site_get_place(site, plan->station, &now);
    if (plan->to_first) site_get_place(moves->first, plan->station, &to);
    return memcmp(&now, &to, sizeof now) == 0;
}

void device_begin_move(struct device *device, uint32_t session, const char *line, int64_t t_ns,
                       const struct command_result *command)
{
    struct device_moves *moves = &device->moves;
    struct device_move *plan = &moves->plan;
    device->cmd.moving = command->station;
    read_move(command, plan);
    plan->session = session;
    plan->t_ns = t_ns;
    plan->stays = is_there(moves, device->site, plan);
    snprintf(plan->line, sizeof plan->line, "%s", line);
}

static void moves_warn(void *ctx, const char *text)
{
    const struct device *device = ctx;
    sh_warn(device->options.report, "%s", text);
}

static int move_stops(void *ctx)
{
    const struct device *device = ctx;
    return atomic_load(&device->moves.stops);
}

/* Makes the site of a plan from the site `from`. Warnings go to the device's report; no progress is drawn, since the
 * head serves meanwhile. */
static struct device_version *make_moved(struct device *device, const struct site *from, const struct device_move *plan,
                                         struct sh_err *err)
{
    struct device_moves *moves = &device->moves;
    const struct sh_report report = {device, moves_warn, NULL, move_stops, NULL};
    const struct site_station_move move = {moves->first, plan->station, plan->to_first ? NULL : &plan->to};
    struct site *site;
    int rc = site_load_moved(from, &move, &report, &site, err);
    if (rc != SH_OK) return NULL;
    struct device_version *version = device_make_version(site, site);
    if (version == NULL) site_free(site);
    if (version == NULL) sh_fail(err, SH_ENOMEM, "no memory for a station's place");
    return version;
}

/* Returns whether the version that was planned ahead differs from the present site only in the station to be moved. A
 * replay with other options may refuse commands of its journal. Then the version has moves that were not made. */
static int is_next(const struct device_moves *moves)
{
    const struct site *now = moves->current->site, *next = moves->ahead->site;
    int same = is_there(moves, next, &moves->plan);
    for (uint32_t i = 0; i < now->n_stations; i++) {
        struct site_place a, b;
        site_get_place(now, i, &a);
        site_get_place(next, i, &b);
        same &= i == moves->plan.station || memcmp(&a, &b, sizeof a) == 0;
    }
    return same;
}

void device_plan_move(struct device *device)
{
    struct device_moves *moves = &device->moves;
    moves->err = (struct sh_err){0, ""};
    device_free_unused(&moves->old, NULL);
    if (moves->plan.stays) return;
    if (moves->ahead != NULL && !is_next(moves)) device_free_versions(&moves->ahead);
    moves->made = moves->ahead;
    if (moves->made != NULL)
        moves->ahead = moves->made->next;
    else
        moves->made = make_moved(device, moves->current->site, &moves->plan, &moves->err);
    if (moves->made != NULL) moves->made->next = NULL;
}

/* The order of moves is known: a journal has only moves that were done, and during a replay nobody else moves a
 * station. A move that can't be planned ahead, or is one too many, is planned when it is due. */
void device_plan_ahead(struct device *device)
{
    struct device_moves *moves = &device->moves;
    const struct device_journal *journal = &device->journal;
    struct device_version **end = &moves->ahead;
    const struct site *from = device->site;
    struct command_device scratch = device->cmd; /* for reading lines */
    scratch.state = HEAD_IDLE;
    scratch.can_plan = NULL;
    scratch.faults = NULL; /* faults are added at their own times */
    int n = 0;
    for (size_t i = 0; i < journal->n_replay && n < MAX_AHEAD; i++) {
        struct command_result result;
        struct device_move plan;
        struct sh_err err;
        if (journal_pose(&journal->replay[i]) != NULL) continue; /* there may be millions of them */
        command_execute(&scratch, 0, journal->replay[i].line, &result);
        if (result.effect != COMMAND_MOVE) continue;
        read_move(&result, &plan);
        if (is_there(moves, from, &plan)) continue;
        *end = make_moved(device, from, &plan, &err);
        if (*end == NULL) return;
        from = (*end)->site;
        end = &(*end)->next;
        n++;
    }
}

static void refuse(struct device *device, const char *why, struct command_result *out)
{
    const struct device_move *plan = &device->moves.plan;
    char text[160];
    snprintf(text, sizeof text, "SITE:POSE: %.140s", why);
    command_refuse(&device->cmd, CMD_E_SETTINGS, text, out);
    device_push_error(&device->events, plan->session, out->error, command_error_text(out->error));
    if (!plan->took_control || device->cmd.control != plan->session) return;
    device->cmd.control = 0; /* a refused command changes nothing */
    device_push_event(&device->events, NATIVE_EV_CONTROL, 0, 0, 0, "released");
}

static void use(struct device *device, struct device_version *version)
{
    device->moves.current = version;
    device->site = version->site;
}

/* Gives the last scan the present place, with its own settings, since descriptor and anchor are repeated from it. */
static void move_last_scan(struct device *device)
{
    struct device_scan *scan = &device->scan;
    struct device_version *variant = NULL;
    struct sh_err err;
    if (scan->variant != NULL &&
        device_find_variant(device, &scan->variant->settings, scan->station, &variant, &err) != SH_OK)
        variant = NULL;
    scan->variant = variant;
    scan->site = variant != NULL ? variant->site : device->site;
    if (scan->segment.spec.emitter != NULL) scan->segment.spec.emitter = &scan->site->emitter;
    scan->anchor_lost = 1; /* so that the present anchor goes out as a repetition */
}

/* Makes the new site the present one, from the next tick to be claimed on. If the present settings can't be planned at
 * the new place, nothing changes. */
static int swap(struct device *device, struct sh_err *err)
{
    struct device_moves *moves = &device->moves;
    struct device_version *was = moves->current;
    const struct head_settings *now = &device->cmd.settings;
    struct device_version *variant;
    use(device, moves->made);
    int rc = device_find_variant(device, now, now->station - 1, &variant, err);
    if (rc != SH_OK) {
        use(device, was);
        return rc;
    }
    moves->made = NULL;
    was->next = moves->old;
    moves->old = was;
    device_set_places(device->site, moves->place);
    move_last_scan(device);
    device_free_unused(&moves->variants, device->scan.variant); /* these hold the earlier site */
    return SH_OK;
}

/* In the journal a new plan comes before the command that led to it. */
static void write_journal(struct device *device, int64_t t_ns)
{
    const struct device_move *plan = &device->moves.plan;
    struct device_journal *journal = &device->journal;
    char now[sizeof device->plan], note[16 + sizeof now];
    site_plan_text(device->site, now, sizeof now);
    const int is_new = strcmp(now, device->plan) != 0;
    memcpy(device->plan, now, sizeof now);
    if (journal->out == NULL) return;
    snprintf(note, sizeof note, "plan: %s", now);
    if (is_new) journal_note(journal->out, note);
    journal_write(journal->out, device->next_tick, t_ns, plan->session, plan->line);
}

void device_take_move(struct device *device, int64_t t_ns, struct command_result *out)
{
    struct device_moves *moves = &device->moves;
    const struct device_move *plan = &moves->plan;
    memset(out, 0, sizeof *out);
    out->station = plan->station + 1;
    if (plan->stays) {
        snprintf(out->reply, sizeof out->reply, "OK");
        return;
    }
    if (moves->made != NULL && device->machine.state != HEAD_IDLE)
        sh_fail(&moves->err, SH_ESTATE, "the head is not idle any more");
    if (moves->made == NULL || moves->err.code != SH_OK || swap(device, &moves->err) != SH_OK) {
        refuse(device, moves->err.text, out);
        device_free_version(moves->made);
        moves->made = NULL;
        return;
    }
    write_journal(device, t_ns);
    out->changes = 1;
    snprintf(out->reply, sizeof out->reply, "OK");
    device_push_event(&device->events, NATIVE_EV_SITE, plan->station + 1, device->site->warnings.n_new, 0,
                      device->site->station[plan->station].station->name);
}

void device_end_move(struct device *device)
{
    device_free_unused(&device->moves.old, NULL);
    pthread_mutex_lock(&device->lock);
    device->cmd.moving = 0;
    pthread_mutex_unlock(&device->lock);
}

void device_finish_move(struct device *device, uint64_t released, struct command_result *out)
{
    pthread_mutex_lock(&device->lock);
    device_take_move(device, (int64_t)released * device->tick_ns, out);
    pthread_mutex_unlock(&device->lock);
    device_end_move(device);
}

/* ---- sites that others hold */

const struct site *device_hold_site(struct device *device, struct device_version **version)
{
    pthread_mutex_lock(&device->lock);
    *version = device_use(device->moves.current);
    pthread_mutex_unlock(&device->lock);
    return (*version)->site;
}

const struct site *device_hold_scan(struct device *device, uint32_t number, struct device_version **version)
{
    pthread_mutex_lock(&device->lock);
    const struct device_scan *scan = &device->scan;
    *version = scan->variant;
    if (*version == NULL && scan->site == device->moves.current->site) *version = device->moves.current;
    if (scan->number != number) *version = NULL;
    device_use(*version);
    pthread_mutex_unlock(&device->lock);
    return *version != NULL ? (*version)->site : NULL;
}

void device_get_station(struct device *device, uint32_t station, struct device_station *out)
{
    struct device_version *version;
    const struct site *site = device_hold_site(device, &version);
    const struct site_tripod *t = &site->station[station].tripod;
    memset(out, 0, sizeof *out);
    snprintf(out->name, sizeof out->name, "%s", site->station[station].station->name);
    site_get_place(site, station, &out->place);
    out->served = site_serves(site, station);
    out->has_tripod = t->from != NULL && out->served;
    if (out->has_tripod) {
        out->leg_m = t->from->leg_m;
        out->height_m = isnan(t->head_m) ? (double)NAN : t->height_m;
        out->opening_rad = t->opening_rad;
        out->head_above_m = t->from->head_above_m;
        out->legs_heading_deg = t->from->legs_heading_deg;
        out->foot_radius_m = t->from->leg_m * sin(t->opening_rad);
    }
    device_give_back(version);
}
