# turn.sh ENGINE ROUND, called by the decks between their runs: where a study times several engines in one go (ACOPLA_TURNS is set), waits
# until it is this one's turn, so that they are timed one after another, round by round, and each settles its bed once.
[ -n "$ACOPLA_TURNS" ] || exit 0
touch "waiting-$1-$2"
until [ -e "go-$1-$2" ]; do sleep 0.05; done
