/* SPDX-License-Identifier: MIT */
/* A soak and a verdict note what they see from threads of links, of clients and of the board of faults. Each note works
 * on the shared state with its lock held. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/sheet.h"
#include "firmware_sim/app/studio/verdict/held.h"
#include "firmware_sim/app/studio/verdict/watch.h"
#include "tests/unit/lock_rig.h"
#include "tests/unit/soak_rig.h"

static void a_soak_is_locked(void **state)
{
    struct soak_clean_frame frame;
    const struct fault_note drop = note_of(FAULT_DROP, 0, 0, ""), boot = {.kind = FAULT_SLOW_BOOT};
    const struct scanhead_notice gap = {.kind = SCANHEAD_NOTICE_GAP, .seq = HIT, .n = 1};
    struct scanhead_frame event = {.type = SCANHEAD_EVENT, .event = SCANHEAD_EV_STATE};
    (void)state;
    struct soak *soak = soak_rig_make();
    struct soak_link *link = &soak->link[0];
    soak->n_links = 2;
    soak->link[1].soak = soak;
    pthread_mutex_init(&soak->link[1].lock, NULL);
    send_clean(soak);
    TAKES(1, (see(soak, FIRST, 0, 0.0), 0));
    TAKES(1, (soak_heard(soak, &drop), 0));
    TAKES(2, (soak_heard(soak, &boot), 0)); /* a fault of the head is noted by both links */
    TAKES(1, (soak_saw_notice(link, &gap), 0));
    TAKES(1, (soak_saw_inside(link, &event), 0));
    TAKES(1, (soak_saw_state(link, "boot"), 0));
    TAKES(1, soak_is_head_seen(link));
    TAKES(2, (soak_saw_open(link), 0)); /* the link's lock, and the clean reader's */
    TAKES(1, (soak_saw_no_open(link), 0));
    TAKES(2, (soak_saw_end(link), 0)); /* the same two */
    TAKES(1, soak_clean_get(soak, FIRST, &frame));
    TAKES(1, soak_clean_top(soak));
    TAKES(1, soak_clean_t_ns(soak));
    soak_rig_end(soak);
}

static void packets_are_locked(void **state)
{
    const struct link_spec spec = {.type = LINK_UDP, .port = 0};
    struct link_spec clean;
    struct soak_link link = {.number = 1};
    (void)state;
    pthread_mutex_init(&link.lock, NULL);
    link.datagrams = soak_datagrams_open(&spec, &clean);
    assert_non_null(link.datagrams);
    TAKES(1, (soak_datagrams_step(&link), 0));
    TAKES(1, soak_datagrams_top(&link));
    soak_datagrams_close(link.datagrams);
}

static void a_watch_is_locked(void **state)
{
    const struct fault_note note = {.kind = FAULT_DISCONNECT, .link = 1};
    struct watch watch, *w = &watch;
    (void)state;
    watch_begin(w, 1, 1, 1.0);
    TAKES(1, (w->observer.session(w, 1, 1, "127.0.0.1:5", 0), 0));
    TAKES(1, (w->observer.heard(w, 1, "x", 1), 0));
    TAKES(1, (w->observer.refused(w, 1, "x", "ERR -113"), 0));
    TAKES(1, (watch_note(w, &note), 0));
    TAKES(1, (w->observer.session(w, 1, 0, "127.0.0.1:5", 0), 0));
    TAKES(1, watch_is_whole(w));
    TAKES(1, watch_over_ns(w));
    TAKES(1, watch_first_open_ns(w));
    w->broken[0].peer[0] = '\0'; /* without a peer no table of the system is read */
    TAKES(1, held_any(w));
    TAKES(1, (watch_end(w), 0));
    watch_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_soak_is_locked),
        cmocka_unit_test(packets_are_locked),
        cmocka_unit_test(a_watch_is_locked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
