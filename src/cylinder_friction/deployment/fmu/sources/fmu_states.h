/* Saved states of an instance: copied, turned into bytes, and read again. */
#ifndef FMU_STATES_H
#define FMU_STATES_H

#include "fmu_instance.h"

/* What goes before a stored state: it fits only the model, and the build, that it came from. */
typedef struct {
    char token[sizeof(FMU_MODEL_TOKEN)];
    uint64_t size;
    uint64_t checksum;
} fmu_stored_head;

/* Copies the instance's state into *saved, which is made if it is NULL. */
static bool fmu_save(fmu_instance *instance, const char *what, void **saved)
{
    if (*saved == NULL) {
        *saved = malloc(sizeof(fmu_state));
        if (*saved == NULL) {
            (void)snprintf(instance->message, sizeof instance->message, "%s: no memory for %lu bytes", what,
                           (unsigned long)sizeof(fmu_state));
            return false;
        }
    }
    memcpy(*saved, &instance->state, sizeof(fmu_state));
    return true;
}

/* FNV-1a: finds a damaged byte; it is no protection against intent. */
static uint64_t fmu_checksum(const unsigned char *bytes, size_t size)
{
    uint64_t hash = 0xcbf29ce484222325U;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ bytes[i]) * 0x100000001b3U;
    }
    return hash;
}

static size_t fmu_stored_size(void)
{
    return sizeof(fmu_stored_head) + sizeof(fmu_state);
}

static bool fmu_store(fmu_instance *instance, const char *what, const void *saved, unsigned char *bytes, size_t size)
{
    fmu_stored_head head;
    if (size < fmu_stored_size()) {
        (void)snprintf(instance->message, sizeof instance->message, "%s: expected room for %lu bytes, but got %lu",
                       what, (unsigned long)fmu_stored_size(), (unsigned long)size);
        return false;
    }
    memset(&head, 0, sizeof head);
    memcpy(head.token, FMU_MODEL_TOKEN, sizeof head.token);
    head.size = sizeof(fmu_state);
    head.checksum = fmu_checksum(saved, sizeof(fmu_state));
    memcpy(bytes, &head, sizeof head);
    memcpy(bytes + sizeof head, saved, sizeof(fmu_state));
    return true;
}

static bool fmu_restore(fmu_instance *instance, const char *what, const unsigned char *bytes, size_t size, void **saved)
{
    fmu_stored_head head;
    if (size != fmu_stored_size()) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: expected a stored state of %lu bytes, but got %lu", what, (unsigned long)fmu_stored_size(),
                       (unsigned long)size);
        return false;
    }
    memcpy(&head, bytes, sizeof head);
    if (memcmp(head.token, FMU_MODEL_TOKEN, sizeof head.token) != 0 || head.size != sizeof(fmu_state)) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: expected a stored state of this model, %s, but got "
                       "another's",
                       what, FMU_MODEL_TOKEN);
        return false;
    }
    if (head.checksum != fmu_checksum(bytes + sizeof head, sizeof(fmu_state))) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: the stored state is damaged: its checksum differs", what);
        return false;
    }
    if (*saved == NULL && !fmu_save(instance, what, saved)) {
        return false;
    }
    memcpy(*saved, bytes + sizeof head, sizeof(fmu_state));
    return true;
}

#endif
