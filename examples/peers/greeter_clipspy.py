"""The hello world of the blackboard's README in CLIPS. A rule fires on facts; why a fact is there is not kept."""

import clips

environment = clips.Environment()
environment.build("(deftemplate heard (slot text (type STRING)))")
environment.build("(deftemplate greeting (slot text (type STRING)))")
environment.build('(defrule greeter (heard (text ?text)) => (assert (greeting (text (str-cat "hello, " ?text)))))')
environment.find_template("heard").assert_fact(text="world")
environment.run()
print(next(fact["text"] for fact in environment.facts() if fact.template.name == "greeting"))
